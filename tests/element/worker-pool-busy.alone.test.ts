/**
 * The workers of a page on a busy machine: a worker that reads nothing is only late, and a download is not restarted early.
 * SECURITY.md: "An untrusted scene delays no other scene".
 */
import assert from 'node:assert/strict';
import { test, type TestContext } from 'node:test';
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

test('a load that no worker begins to read in minutes ends in an error that does not speak of memory', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const answer = pool.run({ type: 'load' } as WorkerRequest, new AbortController().signal, never);
  const outcome = answer.catch((error: unknown) => error);
  await pass(150_000);
  assert.equal(((await outcome) as { code: string }).code, 'network/interrupted');
  assert(workers.length <= 5, `${workers.length} workers`);
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

const load = (url: string, source?: number): WorkerRequest =>
  ({ type: 'load', request: { url, source } }) as unknown as WorkerRequest;

/** Requests of different scenes that workers read without an end. */
async function occupy(
  { pool, workers, pass }: ReturnType<typeof poolOf>,
  count: number,
  requestOf = (k: number): WorkerRequest => load(`hostile-${k}`),
): Promise<AbortController> {
  const abort = new AbortController();
  for (let k = 0; k < count; k++) {
    void pool.run(requestOf(k), abort.signal, never).catch(() => undefined);
    await settle();
    workers.at(-1)!.say({ type: 'reading', id: k });
    await pass(300);
  }
  return abort;
}

test('nine scenes that are read without an end do not delay a tenth', async (context) => {
  const own = poolOf(context);
  await occupy(own, 9);
  assert.equal(own.workers.length, 9);
  const answer = own.pool.run(load('honest'), new AbortController().signal, never);
  await settle();
  assert.equal(own.workers.length, 10, 'it has a worker at once');
  own.workers.at(-1)!.say({ type: 'answer', id: 9, answer: 'scene' });
  assert.equal(await answer, 'scene');
});

test('elements that show the same file do not share its worker time', async (context) => {
  const own = poolOf(context);
  await occupy(own, 10, (k) => load('the same', k));
  assert.equal(own.workers.length, 10, 'each has a worker at once');
});

test('a scene that has had its time waits for those that have had none', async (context) => {
  const own = poolOf(context);
  await occupy(own, 16);
  await own.pass(500);
  const outcomes: string[] = [];
  const ask = (url: string): void =>
    void own.pool.run(load(url), new AbortController().signal, never).then((answer) => outcomes.push(String(answer)));
  ask('hostile-0');
  ask('honest');
  await settle();
  assert.equal(own.workers.length, 16, 'all workers are occupied');
  await own.pass(200);
  const ended = own.workers.filter(({ isEnded }) => isEnded);
  assert.equal(ended.length, 1, 'one has had its turn');
  own.workers[16].say({ type: 'answer', id: 17, answer: 'honest' });
  await settle();
  assert.deepEqual(outcomes, ['honest']);
});
