/** SECURITY.md: "Requests are those of `<img crossorigin>`". */
import { GaussianSplatElement } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  claimComing,
  COMPASS,
  delay,
  nextEvent,
  show,
  showLoaded,
  until,
  hurry,
} from './support/harness.js';

const SCRIPT = '/packages/element/dist/loading/scene-worker.js';
const PlainWorker = Worker;

/** All workers that the page has started, and whether they were ended. */
const workers: { worker: Worker; isEnded: boolean }[] = [];
window.Worker = class extends Worker {
  readonly #record = { worker: this as Worker, isEnded: false };
  constructor(script: string | URL, options?: WorkerOptions) {
    super(script, options);
    workers.push(this.#record);
  }
  override terminate(): void {
    this.#record.isEnded = true;
    super.terminate();
  }
};

/** A worker that takes its time, on a machine that is busy, is none that does not come: its script has been fetched before, and the page's clock is slow. */
before(async () => {
  const worker = new PlainWorker(SCRIPT, { type: 'module' });
  await nextEvent(worker, 'message', 60_000);
  worker.terminate();
});
beforeEach(() => hurry(0.3));

describe('the scene worker', () => {
  it('is one for all elements, ends when idle, and starts again', async () => {
    const elements = [show({ src: COMPASS }), show({ src: COMPASS }), show({ src: COMPASS })];
    await Promise.all(elements.map((element) => element.ready));
    assert(
      elements.every((element) => element.loaded),
      'all loaded',
    );
    assertEqual(workers.length, 1, 'workers');
    hurry(12);
    // The time until the end begins with the last load.
    await showLoaded();
    await until(() => workers[0].isEnded, 'the end of an idle worker');
    hurry(0.3);
    await showLoaded();
    assertEqual(workers.length, 2, 'workers after another load');
  });

  it('that dies is replaced once for a scene; then that has an error, and the next load starts another', async () => {
    const element = show({ src: '/net/slow/compass.ply?ms=3000' });
    const died: Worker[] = [];
    for (let count = 0; count < 2; count++) {
      await nextEvent(element, 'progress');
      await delay(200);
      const { worker } = workers[workers.length - 1];
      worker.dispatchEvent(new ErrorEvent('error', { message: 'out of memory', cancelable: true }));
      died.push(worker);
    }
    await element.ready;
    assertEqual(element.error?.reason, 'out-of-memory/allocation');
    await showLoaded();
    assert(died[0] !== died[1] && workers.at(-1)!.worker !== died[1], 'three workers');
  });

  it('answers also after an unexpected failure', async () => {
    const loader = GaussianSplatElement.sceneLoader;
    const failed = loader.ask('boxes', null as never, new AbortController().signal).catch((error) => error);
    const error: unknown = await Promise.race([failed, delay(10_000)]);
    assert(error instanceof Error && /decode\/corrupt/.test(error.message), `an error with a name: ${String(error)}`);
  });

  it("'that is refused is replaced by the main thread, with one warning for all elements'", async () => {
    type SceneLoader = (typeof GaussianSplatElement)['sceneLoader'];
    const original = GaussianSplatElement.sceneLoader;
    const Loader = original.constructor as new (spawn: () => Worker) => SceneLoader;
    GaussianSplatElement.sceneLoader = new Loader(() => new Worker('/net/status/404', { type: 'module' }));
    try {
      await Promise.all([showLoaded(), showLoaded()]);
      await showLoaded();
    } finally {
      GaussianSplatElement.sceneLoader = original;
    }
    await claimComing(/console\.warn: <gaussian-splat>: no worker could be started .*workerLocation/);
  });

  it('lies where workerLocation says, and is named in the warning if it does not', async () => {
    const original = GaussianSplatElement.sceneLoader;
    const Loader = original.constructor as new (spawn: undefined, locationOf: () => string | null) => typeof original;
    const Original = globalThis.Worker;
    const asked: string[] = [];
    globalThis.Worker = class extends Original {
      constructor(url: string | URL, options?: WorkerOptions) {
        asked.push(new URL(url, location.href).pathname);
        super(url, options);
      }
    };
    const place = SCRIPT;
    try {
      for (const address of [place, '/net/status/404']) {
        GaussianSplatElement.sceneLoader = new Loader(undefined, () => GaussianSplatElement.workerLocation);
        GaussianSplatElement.workerLocation = address;
        await showLoaded();
      }
    } finally {
      GaussianSplatElement.sceneLoader = original;
      GaussianSplatElement.workerLocation = null;
      globalThis.Worker = Original;
    }
    assertEqual(asked, [place, '/net/status/404'], 'scripts');
    await claimComing(/no worker could be started .* GaussianSplatElement.workerLocation is \/net\/status\/404/);
  });
});
