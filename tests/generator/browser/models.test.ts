/** The papers' functions and their registry; in the laboratory also the build that a page loads from a CDN. */
import {
  addGaussianModelToScene,
  GaussianModels,
  Generator,
  loadAllGenerators,
  onFrame,
  onGenerated,
  registerGaussianGenerator,
  runGenerators,
} from '@gaussian-splat/generator';
import { DynamicGaussians, World } from '@gaussian-splat/renderer';
import { assert, assertEqual, delay, nextEvent, until } from '../../element/browser/support/harness.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { FIXTURES, makeDevice } from './support.js';

describe('models of a page', () => {
  itInLab('register, load, add, run, and are notified of frames', async () => {
    const device = await makeDevice();
    const models = new GaussianModels();
    models.registerGaussianGenerator('ball', { url: `${FIXTURES}packed.onnx` });
    const early = await models
      .addGaussianModelToScene('ball', () => ({ ingest: () => undefined }))
      .catch((e: unknown) => e);
    assertEqual((early as { code: string }).code, 'argument/value', 'before loading');
    await models.loadAllGenerators(device);
    const unknown = await models
      .addGaussianModelToScene('cube', () => ({ ingest: () => undefined }))
      .catch((e: unknown) => e);
    assertEqual((unknown as { code: string }).code, 'argument/value', 'an unknown name');
    const add = (): ReturnType<typeof models.addGaussianModelToScene<DynamicGaussians>> =>
      models.addGaussianModelToScene('ball', (layout) => DynamicGaussians.create(device, layout));
    const [a, b] = [await add(), await add()];
    const heard: [number, number | undefined][] = [];
    const stop = models.onGenerated((model, { state }) => heard.push([model === a ? 0 : 1, state.timeSeconds]));
    b.state = { timeSeconds: 9 };
    models.runGenerators({ timeSeconds: 1 });
    await Promise.all([a.generator.idle, b.generator.idle]);
    assertEqual(heard.sort(), [
      [0, 1],
      [1, 9],
    ]);
    assert(a.gaussians.version === 2 && b.gaussians.version === 2, 'each has taken one run in');
    models.runGenerators({ timeSeconds: 2 });
    await Promise.all([a.generator.idle, b.generator.idle]);
    assertEqual(heard.length, 3, 'the one whose state is its own has not run again');
    stop();
    a.remove();
    models.runGenerators({ timeSeconds: 3 });
    await a.generator.idle;
    assertEqual([heard.length, a.gaussians.version], [3, 3], 'after removal');
    models.clear();
    for (const { gaussians } of [a, b]) gaussians.destroy();
    device.destroy();
  });
});

describe('the five functions of the papers', () => {
  it('put models into a world, and take what a callback gives before each run', async () => {
    const device = await makeDevice();
    const world = new World();
    registerGaussianGenerator('ball', { url: `${FIXTURES}packed.onnx` });
    await loadAllGenerators(device);
    const sceneToWorld = [1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    const a = await addGaussianModelToScene('ball', world, { sceneToWorld });
    const b = await addGaussianModelToScene('ball', world);
    assertEqual([world.placements.length, a.placement.sceneToWorld?.[3], a.name], [2, 2, 'ball']);
    assert(world.placements[0].scene === a.gaussians, 'what is drawn is what it writes');
    const shown: (number | undefined)[][] = [];
    const deaf = onGenerated((model, { state }) => shown.push([model === a ? 0 : 1, state.timeSeconds, state.seed]));
    let time = 3;
    const stop = onFrame((state, model) => (model === a ? { timeSeconds: time++, seed: state.seed } : undefined));
    const run = async (...given: Parameters<typeof runGenerators>): Promise<void> => {
      runGenerators(...given);
      await Promise.all([a.generator.idle, b.generator.idle]);
    };
    await run({ timeSeconds: 1, seed: 5 });
    const { drawn, bounds } = await a.gaussians.readSample();
    assert(drawn > 0 && bounds.max[0] > bounds.min[0], `${drawn} Gaussians to draw`);
    await run();
    stop();
    await run({ timeSeconds: 7 });
    assertEqual(
      shown.filter(([model]) => model === 0).map(([, at]) => at),
      [3, 4, 7],
    );
    assertEqual(shown.find(([model]) => model === 1)?.slice(1), [1, 5], 'the other has the state of the page');
    a.state = { controls: { twitst: 1 } };
    assertEqual(
      codeOf(() => runGenerators()),
      'argument/value',
    );
    a.remove();
    assertEqual(world.placements.length, 1, 'removed from the world, too');
    for (const scene of [{}, { isObject3D: true, add: () => undefined }, undefined]) {
      const error: unknown = await addGaussianModelToScene('ball', scene as unknown as World).catch((e: unknown) => e);
      assertEqual((error as { code: string }).code, 'argument/value', `a scene of ${typeof scene}`);
    }
    deaf();
    b.remove();
    device.destroy();
  });
});

function codeOf(work: () => void): string {
  try {
    work();
  } catch (error) {
    return (error as { code: string }).code;
  }
  return 'none';
}

describe('generators of a page that are not wanted any more', () => {
  itInLab('are closed: of a sink that cannot be made, of two loads at once, and cleared while they load', async () => {
    const device = await makeDevice();
    const models = new GaussianModels();
    const { open } = Generator;
    const opened: Generator[] = [];
    let closed = 0;
    Generator.open = async (...rest) => {
      const generator = await open.apply(Generator, rest);
      const { close } = generator;
      generator.close = () => (closed++, close.call(generator));
      opened.push(generator);
      return generator;
    };
    const failure = (work: Promise<unknown>): Promise<string> =>
      work.then(
        () => 'none',
        (error: Error) => error.message,
      );
    try {
      models.registerGaussianGenerator('ball', { url: `${FIXTURES}packed.onnx` });
      await Promise.all([models.loadAllGenerators(device), models.loadAllGenerators(device)]);
      assertEqual(opened.length, 1, 'two loads at once');
      const noSink = models.addGaussianModelToScene('ball', () => Promise.reject(new Error('no sink')));
      assertEqual(await failure(noSink), 'no sink');
      assertEqual([opened.length, closed], [2, 1], 'without a sink');
      let sinkWanted = (): void => undefined;
      const wanted = new Promise<void>((resolve) => (sinkWanted = resolve));
      const late = failure(
        models.addGaussianModelToScene('ball', async () => {
          sinkWanted();
          await delay(50);
          return { ingest: () => undefined };
        }),
      );
      await wanted;
      models.clear();
      assert(/abort/i.test(await late), 'the model that was on its way');
      assertEqual([opened.length, closed], [3, 3], 'cleared');
      models.registerGaussianGenerator('ball', { url: `${FIXTURES}packed.onnx` });
      const loading = failure(models.loadAllGenerators(device));
      models.clear();
      assert(/abort/i.test(await loading), 'the load');
      await delay(300);
      assertEqual(opened.length, closed, 'cleared while it loads');
    } finally {
      Generator.open = open;
      device.destroy();
    }
  });
});

describe('the CDN build', () => {
  itInLab('shows a generator with the runtime that is beside it', async () => {
    const frame = document.createElement('iframe');
    document.body.append(frame);
    await (frame.contentDocument?.readyState === 'complete' ? undefined : nextEvent(frame, 'load'));
    const page = frame.contentDocument;
    assert(page, 'a page in the frame');
    page.body.innerHTML = `<gaussian-splat src="${FIXTURES}packed.onnx" loading="eager" style="display: block; width: 100px; height: 100px"></gaussian-splat>`;
    const script = page.createElement('script');
    script.type = 'module';
    script.src = '/packages/element/cdn/gaussian-splat.min.js';
    page.head.append(script);
    const element = page.querySelector('gaussian-splat');
    assert(element, 'the element');
    await until(() => element.loaded || !!element.error, 'the scene', 40_000);
    assert(element.loaded, String(element.error?.message));
    const fetched = frame.contentWindow?.performance
      .getEntriesByType('resource')
      .map(({ name }) => new URL(name).pathname);
    assert(
      fetched?.some((path) => /cdn\/onnxruntime\/.*\.wasm$/.test(path)),
      `fetched ${fetched?.join(' ')}`,
    );
  });
});
