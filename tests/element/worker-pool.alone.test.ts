/** The workers of a page: a simulated worker, and the test's clock. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { type WorkerRequest, WorkerPool } from '../support/element/loading.js';

class FakeWorker extends EventTarget {
  readonly posted: string[] = [];
  isEnded = false;

  postMessage({ type }: { type: string }): void {
    this.posted.push(type);
  }

  terminate(): void {
    this.isEnded = true;
  }
}

test('a load that is canceled while its worker is late never reaches the worker, which ends when idle', async (context) => {
  context.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  const worker = new FakeWorker();
  const pool = new WorkerPool(
    () => worker as unknown as Worker,
    () => Promise.resolve(),
    () => undefined,
  );
  const settle = (): Promise<void> => new Promise((resolve) => setImmediate(resolve));
  const over = new AbortController();
  const here = (): Promise<never> => Promise.reject(new Error('not on the main thread'));
  const loading = pool
    .run({ type: 'load', request: {} } as WorkerRequest, over.signal, here)
    .catch((error: unknown) => error);
  context.mock.timers.tick(2_000);
  await settle();
  over.abort();
  assert.equal(await loading, over.signal.reason);
  worker.dispatchEvent(new MessageEvent('message', { data: { type: 'ready' } }));
  context.mock.timers.tick(500);
  await settle();
  assert.deepEqual(worker.posted, []);
  context.mock.timers.tick(5_000);
  assert.equal(worker.isEnded, true);
});
