/** Orders of WebGL scenes are sorted by a worker, whenever the page asks for the first one. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { orderView } from '@gaussian-splat/renderer/webgl';
import { DepthSorter } from '../support/element/parts.js';
import { cameraAt } from '../support/scenes.js';

/** A worker that has started, and records the messages of the page. */
class FakeWorker extends EventTarget {
  readonly received: { readonly type: string; readonly port: MessagePort }[] = [];

  constructor() {
    super();
    queueMicrotask(() => this.dispatchEvent(new MessageEvent('message', { data: { type: 'ready' } })));
  }

  postMessage(message: (typeof this.received)[number]): void {
    this.received.push(message);
  }

  terminate(): void {
    for (const { port } of this.received) port.close();
  }
}

test('a page that was hidden for a minute before its first order still leaves the sort to the worker', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const worker = new FakeWorker();
  const orders: number[] = [];
  const sorter = new DepthSorter({
    positions: Float32Array.of(0, 0, 1, 0, 0, 2),
    spawn: () => worker as unknown as Worker,
    onOrder: ({ count }) => orders.push(count),
  });
  for (let turn = 0; turn < 5; turn++) await Promise.resolve();
  t.mock.timers.tick(60_000);
  const [{ type, port }] = worker.received;
  assert.equal(type, 'sort');
  const asked = new Promise((resolve) => (port.onmessage = resolve));
  sorter.request(orderView(cameraAt([0, 0, 0], [0, 0, 1]), [0, 0, 0]));
  t.mock.timers.tick(0);
  await asked;
  assert.deepEqual(orders, [], 'the page itself sorts nothing');
  // A worker that does not answer is replaced by the main thread.
  t.mock.timers.tick(2_000);
  t.mock.timers.tick(0);
  assert.deepEqual(orders, [2]);
  sorter.destroy();
});
