/** The workers of a page on a busy machine: a worker that reads nothing is only late, and a download is not restarted early. */
import assert from 'node:assert/strict';
import { test, type TestContext } from 'node:test';
import type { WorkerRequest } from '../../packages/element/src/loading/protocol.js';
import { WorkerPool } from '../../packages/element/src/loading/worker-pool.js';

class FakeWorker extends EventTarget {
  readonly posted: string[] = [];
  isEnded = false;
  postMessage({ type }: { type: string }): void {
    this.posted.push(type);
  }
  terminate(): void {
    this.isEnded = true;
  }
  say(data: object): void {
    this.dispatchEvent(new MessageEvent('message', { data }));
  }
}

const settle = (): Promise<void> => new Promise((resolve) => setImmediate(resolve));

function poolOf(context: TestContext): { pool: WorkerPool; workers: FakeWorker[]; pass(ms: number): Promise<void> } {
  // The mock intervals of Node run too often if they are set and cleared within one another.
  const ticks = new Set<() => void>();
  context.mock.method(globalThis, 'setInterval', (tick: () => void) => ticks.add(tick) && tick);
  context.mock.method(globalThis, 'clearInterval', (tick: () => void) => ticks.delete(tick));
  context.mock.method(globalThis, 'setTimeout', () => 0);
  const workers: FakeWorker[] = [];
  let now = performance.now();
  context.mock.method(performance, 'now', () => now);
  const pool = new WorkerPool(
    () => {
      const worker = new FakeWorker();
      workers.push(worker);
      queueMicrotask(() => worker.say({ type: 'ready' }));
      return worker as unknown as Worker;
    },
    () => Promise.resolve(),
    () => undefined,
  );
  const pass = async (ms: number): Promise<void> => {
    for (let t = 0; t < ms; t += 100) {
      now += 100;
      for (const tick of ticks) tick();
      await settle();
    }
  };
  return { pool, workers, pass };
}

const never = (): Promise<never> => Promise.reject(new Error('not on the main thread'));

test('on a machine that gives no worker time for 30 s, a load fails not, and the last worker may end it', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const answer = pool.run({ type: 'load' } as WorkerRequest, new AbortController().signal, never);
  const outcome = answer.catch((error: unknown) => error);
  await pass(30_000);
  workers.at(-1)!.say({ type: 'answer', id: 0, answer: 'scene' });
  assert.equal(await outcome, 'scene');
  assert(workers.length <= 4, `${workers.length} workers`);
});

test('a load whose buffers are transferred waits for its worker', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const transfer = [new ArrayBuffer(8)];
  const answer = pool.run({ type: 'model' } as WorkerRequest, new AbortController().signal, never, { transfer });
  const outcome = answer.catch((error: unknown) => error);
  await pass(30_000);
  workers[0].say({ type: 'answer', id: 0, answer: 'model' });
  assert.equal(await outcome, 'model');
});

test('a download of 8 s is not given up for a silence of 5 s', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  void pool.run({ type: 'load' } as WorkerRequest, new AbortController().signal, never);
  await pass(200);
  for (let t = 0; t < 8_000; t += 100) {
    workers[0].say({ type: 'pong' });
    await pass(100);
  }
  await pass(5_000);
  assert.equal(workers.length, 1);
});

test('a download of 8 s is not given up for another scene that is read for one second', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const { signal } = new AbortController();
  void pool.run({ type: 'load' } as WorkerRequest, signal, never);
  void pool.run({ type: 'load' } as WorkerRequest, signal, never);
  await pass(200);
  for (let t = 0; t < 8_000; t += 100) {
    workers[0].say({ type: 'pong' });
    await pass(100);
  }
  workers[0].say({ type: 'reading', id: 0 });
  await pass(1_000);
  assert.equal(workers.length, 1);
  // A scene that never ends keeps the other one for as long again at most.
  await pass(10_000);
  assert(workers.length >= 2, 'the other scene has another worker');
});
