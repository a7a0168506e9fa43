import { GaussianSplatElement, SharedDevice } from '@gaussian-splat/element';
import { assert, assertEqual, claimComing, COMPASS, FIXTURES, show, showLoaded } from './support/harness.js';

type SceneLoader = (typeof GaussianSplatElement)['sceneLoader'];
const original = GaussianSplatElement.sceneLoader;
const Loader = original.constructor as new (spawn?: () => Worker) => SceneLoader;

/** A loader of a page that refuses its worker. */
const withoutWorker = (): SceneLoader => new Loader(() => new Worker('/net/status/404', { type: 'module' }));

/** From now on a file, by the end of its path, is not found; without one all are. */
const lose = (end = ''): Promise<unknown> => fetch(`/net/lose/${end}`);

async function assertLost(src: string, file: string, work: RegExp): Promise<GaussianSplatElement> {
  await lose(file);
  const element = show({ src });
  await element.ready;
  const { code, reason, message = 'no error' } = element.error ?? {};
  assertEqual([code, reason], ['network', 'network/unreachable'], message);
  assert(work.test(message), `what could not be loaded: ${message}`);
  assert(message.includes(file), `and its address: ${message}`);
  assert(/serve/i.test(message) && /Content-Security-Policy/.test(message), `and what to do: ${message}`);
  return element;
}

describe('code that cannot be loaded when it is needed', () => {
  beforeEach(() => {
    GaussianSplatElement.sceneLoader = new Loader();
  });
  afterEach(async () => {
    GaussianSplatElement.sceneLoader = original;
    await lose();
  });

  // A page keeps loaded code for good: missing code is tested before available code.
  it('is reported as such: all that reads scenes, worker or not, and load() tries again', async () => {
    const script = '/packages/element/dist/loading/scene-worker.js';
    let workers = 0;
    GaussianSplatElement.sceneLoader = new Loader(() => {
      workers++;
      return new Worker(script, { type: 'module' });
    });
    const element = await assertLost('/net/status/404', 'loading/scene-worker.js', /reads scenes/);
    await claimComing(/no worker could be started/);
    // When available, it is used: then only the scene is missing, which needs none of the code that the tests below
    // omit.
    await lose();
    element.load();
    await element.ready;
    assertEqual([element.error?.reason, workers], ['network/status', 2], 'error, workers');
  });

  it('in the worker: the reader of a format', async () => {
    await assertLost(`${FIXTURES}compass.ply`, 'worker-code/ply.js', /reads PLY/);
  });

  it('in the worker: what knows files that are no scene', async () => {
    await assertLost('/net/html', 'diagnose.js', /code for other files/);
  });

  it("'on the main thread: the reader of a format, and another format is read'", async () => {
    GaussianSplatElement.sceneLoader = withoutWorker();
    await assertLost(COMPASS, 'readers/splat.js', /reads \.splat/);
    await claimComing(/no worker could be started/);
    await showLoaded({ src: `${FIXTURES}compass.ply` });
  });

  it('for WebGL, which comes after the splats of a large scene, shows them', async () => {
    const { sharedDevice } = GaussianSplatElement;
    GaussianSplatElement.sharedDevice = new SharedDevice();
    Object.defineProperty(navigator, 'gpu', {
      configurable: true,
      value: { requestAdapter: () => Promise.resolve(null) },
    });
    try {
      await fetch('/net/hold/webgl/open-gl-scene.js?ms=2500');
      const row = new Uint8Array([
        ...new Uint8Array(new Float32Array([0, 0, 0, 0.1, 0.1, 0.1]).buffer),
        ...Array<number>(8).fill(200),
      ]);
      const element = show({
        src: `${URL.createObjectURL(new Blob(Array<Uint8Array<ArrayBuffer>>(40_000).fill(row)))}#a.splat`,
      });
      await element.ready;
      assertEqual([element.error, element.stats?.renderer, element.stats?.splats], [null, 'webgl', 40_000], 'scene');
      element.remove();
    } finally {
      await fetch('/net/hold/');
      Reflect.deleteProperty(navigator, 'gpu');
      GaussianSplatElement.sharedDevice = sharedDevice;
    }
  });

  it("'on the main thread: the code for generators'", async () => {
    await assertLost('/tests/fixtures/generators/packed.onnx', 'generator/open-dynamic-model.js', /opens a generator/);
  });
});
