/**
 * The workers of a page on a busy machine: silence ends nothing, and nothing is downloaded twice. A worker that has died is found.
 * SECURITY.md: "An untrusted scene delays no other scene".
 */
import assert from 'node:assert/strict';
import { beforeEach, test, type TestContext } from 'node:test';
import { type WorkerRequest, WorkerPool } from '../support/element/loading.js';

interface Posted {
  readonly type: string;
  readonly name?: string;
  readonly request?: { readonly url: string; readonly downloaded?: Blob };
}

const CORES = 3;
/** Called when locks are released, by the names of the locks. */
const waiting = new Map<string, () => void>();

beforeEach(() => {
  waiting.clear();
  Object.defineProperty(globalThis, 'navigator', { value: { hardwareConcurrency: CORES }, configurable: true });
});

class FakeWorker extends EventTarget {
  readonly posted: Posted[] = [];
  isEnded = false;
  postMessage(message: Posted): void {
    this.posted.push(message);
    if (message.type === 'hold') queueMicrotask(() => this.say({ type: 'holds', name: message.name }));
  }
  /** Ends the thread, as browsers do that run out of memory. */
  async die(): Promise<void> {
    for (const { type, name } of this.posted) if (type === 'hold') waiting.get(name!)?.();
    await settle();
  }
  get reads(): string[] {
    return this.posted.flatMap(({ request }) => request?.url ?? []);
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
const load = (url: string, source?: number): WorkerRequest =>
  ({ type: 'load', request: { url, source } }) as unknown as WorkerRequest;
const { signal } = new AbortController();

/** Lets the browser of a test report that a worker has ended: Node has no Web Locks. */
function reportEnds(): void {
  const locks = {
    request: async (name: string, _: object, onHeld: () => void) => void waiting.set(name, onHeld),
  };
  Object.defineProperty(globalThis, 'navigator', { value: { hardwareConcurrency: CORES, locks }, configurable: true });
}

test('20 minutes without CPU end in the scene, by the first worker that has received it', async (context) => {
  reportEnds();
  const { pool, workers, pass } = poolOf(context);
  const outcomes = ['a', 'b'].map((url) => pool.run(load(url), signal, never).catch((error: unknown) => error));
  await pass(200);
  workers[0].say({ type: 'pong' });
  await pass(1_200_000);
  for (const id of [0, 1]) workers[0].say({ type: 'answer', id, answer: 'scene' });
  assert.deepEqual(await Promise.all(outcomes), ['scene', 'scene']);
  assert.equal(workers.length, 1);
});

test('a load that a worker has not received is sent to three others at most, and the last may end it', async (context) => {
  reportEnds();
  const { pool, workers, pass } = poolOf(context);
  const outcome = pool.run(load('a'), signal, never).catch((error: unknown) => error);
  await pass(1_200_000);
  assert.equal(workers.length, 4);
  workers[3].say({ type: 'answer', id: 0, answer: 'scene' });
  assert.equal(await outcome, 'scene');
});

test('nor does a scene fail that is read for 20 minutes', async (context) => {
  reportEnds();
  const { pool, workers, pass } = poolOf(context);
  const outcome = pool.run(load('a'), signal, never).catch((error: unknown) => error);
  await pass(200);
  workers[0].say({ type: 'reading', id: 0 });
  await pass(1_200_000);
  workers[0].say({ type: 'answer', id: 0, answer: 'scene' });
  assert.equal(await outcome, 'scene');
  assert.equal(workers.length, 1);
});

test('where browsers do not report ends, minutes of silence are an error that says what was seen', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const outcome = pool.run(load('a'), signal, never).catch((error: unknown) => error);
  for (let minute = 0; minute < 4; minute++) {
    await pass(200);
    workers.at(-1)!.say({ type: 'pong' });
    await pass(60_300);
    assert.equal(workers.length, Math.min(minute + 2, 4));
  }
  const error = (await outcome) as { code: string; found: string };
  assert.equal(error.code, 'network/interrupted');
  assert.equal(error.found, 'none for 60 s, and no scene that it was reading');
  assert(workers.length <= 5, `${workers.length} workers`);
});

test('a worker that has died is found, another reads its scene, and the second death is the error of the scene', async (context) => {
  reportEnds();
  const { pool, workers, pass } = poolOf(context);
  const outcomes = ['a', 'b'].map((url) => pool.run(load(url), signal, never).catch((error: unknown) => error));
  await pass(200);
  workers[0].say({ type: 'reading', id: 0 });
  await workers[0].die();
  await pass(200);
  assert.equal(workers.length, 3);
  assert.deepEqual(
    workers.slice(1).map(({ reads }) => reads),
    [['a'], ['b']],
  );
  workers[2].say({ type: 'answer', id: 1, answer: 'scene' });
  await workers[1].die();
  const [first, second] = await Promise.all(outcomes);
  assert.equal((first as { code: string }).code, 'out-of-memory/allocation');
  assert.equal(second, 'scene');
});

test('a downloaded scene is handed on as it is, to workers that download nothing', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const count = CORES + 6;
  const outcomes = Array.from({ length: count }, (_, i) => pool.run(load(`${i}`), signal, never));
  await pass(200);
  workers[0].say({ type: 'pong' });
  assert.equal(workers[0].reads.length, count);
  const file = new Blob(['splats']);
  for (let id = 0; id < count - 1; id++) workers[0].say({ type: 'downloaded', id, file });
  await pass(300);
  const readers = workers.slice(1);
  for (const worker of workers) worker.say({ type: 'pong' });
  assert.equal(readers.length, CORES, 'workers that read');
  for (const { posted } of readers)
    assert.equal(posted.find(({ type }) => type === 'load')?.request?.downloaded, file, 'the file itself');
  // The first reader that is done takes the next file.
  readers[0].say({ type: 'answer', id: 0, answer: 'scene' });
  assert.equal(await outcomes[0], 'scene');
  await settle();
  assert.deepEqual(readers[0].reads, ['0', `${CORES}`]);
  // Slow ones do not keep the others waiting.
  await pass(200);
  readers[0].say({ type: 'pong' });
  await pass(1_000);
  assert.equal(workers.length, 1 + CORES);
  await pass(4_000);
  assert(workers.length > 1 + CORES, `${workers.length} workers`);
  assert.equal(workers[0].isEnded, false);
});

test('a load whose buffers are transferred waits for its worker', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const transfer = [new ArrayBuffer(8)];
  const answer = pool.run(load('model'), signal, never, { transfer });
  const outcome = answer.catch((error: unknown) => error);
  await pass(30_000);
  workers[0].say({ type: 'answer', id: 0, answer: 'model' });
  assert.equal(await outcome, 'model');
});

test('a download of 8 s is not given up for another scene that is read for one second', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  for (const url of ['a', 'b']) void pool.run(load(url), signal, never);
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

test('requests for parts of one file have one worker, also if it is busy or others are free', async (context) => {
  const { pool, workers, pass } = poolOf(context);
  const ask = (url: string, keeper?: string): void =>
    void pool
      .run({ type: 'node', request: { url } } as unknown as WorkerRequest, signal, never, { keeper })
      .catch(() => undefined);
  ask('other');
  await settle();
  await pass(300);
  ask('chunk 0', 'park.rad');
  await settle();
  workers[0].say({ type: 'pong' });
  ask('chunk 1', 'park.rad');
  ask('another');
  await pass(300);
  ask('chunk 2', 'park.rad');
  await settle();
  assert.deepEqual(
    workers.map(({ reads }) => reads),
    [
      ['other', 'another'],
      ['chunk 0', 'chunk 1', 'chunk 2'],
    ],
  );
});

test('nodes of a tree are spread over as many workers as the machine has cores', async (context) => {
  const { pool, workers } = poolOf(context);
  const node = { type: 'node', request: { url: 'tile.glb' } } as unknown as WorkerRequest;
  const ask = (): void => void pool.run(node, signal, never).catch(() => undefined);
  for (let count = 0; count < 12; count++) {
    ask();
    await settle();
  }
  assert.deepEqual(
    workers.map(({ reads }) => reads.length),
    [4, 4, 4],
  );
});
