/** Instances of one generator: one run for all that ask in a frame, each with its own pose, and each untouched by the others' faults. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { Generator, type GaussianSink, type GeneratorState } from '@gaussian-splat/generator';
import { assert, assertEqual, delay, nextEvent, showLoaded, until } from '../../element/browser/support/harness.js';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  calls,
  CAMERA,
  codeOf,
  FIXTURES,
  makeDevice,
  numbersOf,
  readBuffer,
  relativeError,
  RUNTIME,
} from './support.js';
import { capture, Renderer } from '../../support/renderer.js';

const FAMILIES = '/tests/fixtures/families/';
const ROWS = 80;
/** Numbers of a Gaussian in each of the avatar's outputs. */
const WIDTHS: Readonly<Record<string, number>> = { positions: 3, covariances: 6, colors: 3, opacities: 1 };

/** All runs of the runtime. */
const runs = { count: 0 };

/** The Gaussians of one instance, as numbers. */
class NumberSink implements GaussianSink {
  readonly rows: Promise<number[]>[] = [];
  readonly #device: GPUDevice;

  constructor(device: GPUDevice) {
    this.#device = device;
  }

  ingest(tensors: Readonly<Record<string, GPUBuffer>>, _rows: number, instance: number): void {
    const parts = Object.entries(tensors).map(async ([name, buffer]) => {
      const numbers = ROWS * WIDTHS[name];
      const all = numbersOf(await readBuffer(this.#device, buffer), 'float32');
      return all.slice(instance * numbers, (instance + 1) * numbers);
    });
    this.rows.push(Promise.all(parts).then((all) => all.flat()));
  }
}

/** A pose of the small avatar (8 joints), other for every number. */
const stateAt = (number: number): GeneratorState => ({
  camera: { ...CAMERA, worldToCamera: [1, 0, 0, 0.1 * number, 0, 1, 0, 0, 0, 0, 1, 8, 0, 0, 0, 1] },
  pose: Array.from({ length: 24 }, (_, i) => 0.6 * Math.sin(1.3 * i + 2.1 * number)),
});

let device: GPUDevice;

const open = (name: string, onError: (error: unknown) => void = (error) => reportError(error)): Promise<Generator> =>
  Generator.open({ url: `${FAMILIES}${name}.onnx` }, device, { onError });

describe('instances of one generator', () => {
  before(async () => {
    device = await makeDevice();
    const { InferenceSession } = (await import(`${RUNTIME}ort.jspi.bundle.min.mjs`)) as {
      InferenceSession: { prototype: { run: (...rest: unknown[]) => unknown } };
    };
    const { run } = InferenceSession.prototype;
    InferenceSession.prototype.run = function countingRun(...rest) {
      runs.count++;
      return run.apply(this, rest);
    };
  });

  itInLab('run together, and each writes what it would write alone', async () => {
    const single = await open('avatar');
    const alone = (single.sink = new NumberSink(device));
    const numbers = [0, 1, 2, 3, 4, 5];
    for (const number of numbers) {
      single.request(stateAt(number));
      await single.idle;
    }
    const expected = await Promise.all(alone.rows);
    single.close();
    const instances = await Promise.all([0, 1, 2].map(() => open('avatar-instances')));
    const sinks = instances.map((generator) => (generator.sink = new NumberSink(device)));
    for (const start of [0, 3]) {
      const before = runs.count;
      instances.forEach((generator, i) => generator.request(stateAt(start + i)));
      await instances[0].idle;
      if (start > 0) assertEqual(runs.count - before, 1, 'runs for three instances');
    }
    for (const [i, sink] of sinks.entries()) {
      assertEqual(sink.rows.length, 2, 'frames of each');
      for (const step of [0, 1]) {
        const error = relativeError(await sink.rows[step], expected[3 * step + i]);
        assert(error <= 1e-6, `instance ${i}, step ${step}: relative error ${error}`);
      }
    }
    assertEqual(instances[0].kind, 'captured');
    // One alone of them: the others' inputs are old, and they are not run.
    const before = runs.count;
    instances[1].request(stateAt(0));
    await instances[1].idle;
    assert(runs.count > before && sinks[0].rows.length === 2, 'only the second has run');
    assert(relativeError(await sinks[1].rows[2], expected[0]) <= 1e-6, 'and shows what it asked for');
    instances.forEach((generator) => generator.close());
  });

  itInLab('of the same frame are one run, whichever callback asks, and nothing is made on the way', async () => {
    const instances = await Promise.all([0, 1, 2].map(() => open('avatar-instances')));
    const scenes = await Promise.all(instances.map(({ model }) => DynamicGaussians.create(device, model.layout)));
    instances.forEach((generator, i) => (generator.sink = scenes[i]));
    let number = 0;
    const frame = async (): Promise<void> => {
      // A callback of its own for each, as elements have them.
      const asked = instances.map(
        (generator) =>
          new Promise<void>((resolve) =>
            requestAnimationFrame(() => {
              generator.request(stateAt(number++));
              resolve();
            }),
          ),
      );
      await Promise.all(asked);
      await instances[0].idle;
    };
    for (let i = 0; i < 3; i++) await frame();
    const [before, made] = [runs.count, { ...calls }];
    for (let i = 0; i < 4; i++) await frame();
    assertEqual(runs.count - before, 4, 'runs in four frames of three instances');
    assertEqual({ ...calls }, made, 'calls');
    // The third is drawn as it would be drawn alone.
    const single = await open('avatar');
    const scene = (single.sink = await DynamicGaussians.create(device, single.model.layout));
    single.request(stateAt(number - 1));
    await single.idle;
    const renderer = new Renderer(device);
    const camera = stateAt(0).camera!;
    const shown = await capture(device, renderer, { gaussians: scenes[2], camera });
    const wanted = await capture(device, renderer, { gaussians: scene, camera });
    assert(
      wanted.some((value) => value > 0.1),
      'something to see',
    );
    assertEqual(
      shown.findIndex((value, i) => Math.abs(value - wanted[i]) > 1e-3),
      -1,
      'pixel that differs',
    );
    [single, ...instances].forEach((generator) => generator.close());
    [scene, ...scenes].forEach((each) => each.destroy());
    renderer.destroy();
  });

  itInLab('cost less together', async () => {
    const millisecondsOf = async (name: string): Promise<number> => {
      const eight = await Promise.all(Array.from({ length: 8 }, () => open(name)));
      for (const generator of eight) generator.sink = { ingest: () => undefined };
      const times: number[] = [];
      for (let frame = 0; frame < 6; frame++) {
        const start = performance.now();
        eight.forEach((generator, i) => generator.request(stateAt(8 * frame + i)));
        await Promise.all(eight.map(({ idle }) => idle));
        await device.queue.onSubmittedWorkDone();
        // The first frames start sessions.
        if (frame > 1) times.push(performance.now() - start);
      }
      eight.forEach((generator) => generator.close());
      return Math.min(...times);
    };
    const [apart, together] = [await millisecondsOf('avatar'), await millisecondsOf('avatar-instances')];
    console.log(`a frame of eight avatars: ${together.toFixed(1)} ms in one run, ${apart.toFixed(1)} ms in eight`);
    assert(together < 0.7 * apart, `${together} ms in one run, ${apart} ms in eight`);
  });

  itInLab('come and go', async () => {
    const errors: unknown[] = [];
    const wanted = new Map<number, number[]>();
    const make = async (): Promise<{ generator: Generator; sink: NumberSink }> => {
      const generator = await open('avatar-instances', (error) => errors.push(error));
      const sink = (generator.sink = new NumberSink(device));
      return { generator, sink };
    };
    const here = [await make()];
    const askAll = async (start: number): Promise<void> => {
      here.forEach(({ generator }, i) => generator.request(stateAt(start + i)));
      await here[0].generator.idle;
      for (const [i, { sink }] of here.entries()) {
        const rows = await sink.rows.at(-1)!;
        const first = wanted.get(start + i);
        if (first) assert(relativeError(rows, first) <= 1e-6, `${here.length} instances, number ${start + i}`);
        else wanted.set(start + i, rows);
      }
    };
    await askAll(0);
    for (const add of [2, 2, 4]) {
      for (let i = 0; i < add; i++) here.push(await make());
      // Up to nine: more than one run takes.
      await askAll(0);
      await askAll(1);
    }
    assertEqual(here.length, 9);
    // One leaves after it has asked, and before the run.
    const [gone] = here.splice(4, 1);
    gone.generator.request(stateAt(50));
    gone.generator.close();
    const heard = gone.sink.rows.length;
    await askAll(0);
    assertEqual(gone.sink.rows.length, heard, 'runs of one that has left');
    here.splice(0, 6).forEach(({ generator }) => generator.close());
    await askAll(1);
    here.forEach(({ generator }) => generator.close());
    assertEqual(errors, []);
  });

  it('are ready independently, though another never rests', async () => {
    const [player, other] = [await open('avatar-instances'), await open('avatar-instances')];
    let plays = true;
    let number = 0;
    player.sink = { ingest: () => plays && queueMicrotask(() => player.request(stateAt(number++))) };
    player.request(stateAt(number++));
    await until(() => player.runs > 0, 'the first run');
    other.sink = new NumberSink(device);
    other.request(stateAt(3));
    const isReady = await Promise.race([other.idle.then(() => true), delay(80_000).then(() => false)]);
    const { runs: meanwhile } = player;
    assert(isReady && other.runs === 1, 'the run of the other');
    await until(() => player.runs > meanwhile, 'another run of what plays');
    plays = false;
    await player.idle;
    for (const generator of [player, other]) generator.close();
    await Promise.all([player.idle, other.idle]);
  });

  it('do not share faults', async () => {
    const errors: [number, unknown][] = [];
    const instances = await Promise.all([0, 1, 2].map((i) => open('avatar-instances', (e) => errors.push([i, e]))));
    const sinks = instances.map((generator) => (generator.sink = new NumberSink(device)));
    const ask = async (state: GeneratorState): Promise<string> =>
      codeOf(Promise.resolve().then(() => instances[1].request(state)));
    instances[0].request(stateAt(0));
    assertEqual(await ask({ ...stateAt(1), pose: [1, 2, 3] }), 'argument/value', 'a pose that is too short');
    assertEqual(await ask({ ...stateAt(1), pose: new Array(24).fill(NaN) }), 'argument/value', 'no numbers');
    instances[2].request(stateAt(2));
    await instances[0].idle;
    assertEqual(
      sinks.map(({ rows }) => rows.length),
      [1, 0, 1],
      'frames',
    );
    // One of them cannot use the other's tensors.
    instances[1].sink = {
      ingest: () => {
        throw new Error('no room');
      },
    };
    instances.forEach((generator, i) => generator.request(stateAt(5 + i)));
    await instances[0].idle;
    assertEqual(
      sinks.map(({ rows }) => rows.length),
      [2, 0, 2],
      'frames',
    );
    assertEqual(
      errors.map(([i, error]) => [i, (error as Error).message]),
      [[1, 'no room']],
    );
    // And is well again.
    instances[1].sink = sinks[1];
    instances[1].request(stateAt(6));
    await instances[1].idle;
    assertEqual(sinks[1].rows.length, 1, 'frames of the one that failed');
    instances.forEach((generator) => generator.close());
  });

  it('are no links of a chain', async () => {
    const url = `${FIXTURES}instances.onnx`;
    assertEqual(await codeOf(Generator.open([{ url }, { url: `${FIXTURES}link.onnx` }], device)), 'contract/chain');
  });

  // Twelve times 40,000 Gaussians a run: on SwiftShader that takes minutes. `examples.alone.test.ts` looks at the file itself.
  itInLab('of the avatar that ships: ten are one run a frame', async () => {
    const url = '/demo/generators/walker/model.onnx';
    const ten = await Promise.all(
      Array.from({ length: 10 }, () => Generator.open({ url }, device, { onError: reportError, gpuCheck: false })),
    );
    const taken = ten.map((generator) => {
      const rows = new Set<number>();
      generator.sink = { ingest: (_tensors, _rows, instance) => void rows.add(instance) };
      return rows;
    });
    const joints = ten[0].model.contract.inputs.pose as { joints: readonly string[] };
    const frame = async (number: number): Promise<number> => {
      const before = runs.count;
      ten.forEach((generator, i) => {
        const pose = Array.from({ length: 3 * joints.joints.length }, (_, k) => 0.2 * Math.sin(k + i + number));
        generator.request({ pose });
      });
      await Promise.all(ten.map(({ idle }) => idle));
      return runs.count - before;
    };
    await frame(0);
    assertEqual([await frame(1), await frame(2)], [1, 1], 'runs in a frame of ten');
    assertEqual(
      taken.map((rows) => [...rows]),
      ten.map((_, i) => [i]),
      'the instance that each takes',
    );
    assertEqual(ten[0].kind, 'captured');
    ten.forEach((generator) => generator.close());
  }).timeout(500_000);

  it('are elements of one page, at times of their own, in one run a frame', async () => {
    GaussianSplatElement.runtimeLocation = RUNTIME;
    const elements = [await showLoaded({ src: `${FIXTURES}instances.onnx` })];
    elements.push(await showLoaded({ src: `${FIXTURES}instances.onnx` }));
    const seek = async (...times: number[]): Promise<number> => {
      const before = runs.count;
      const shown = elements.map((element) => nextEvent(element, 'seeked'));
      elements.forEach((element, i) => (element.currentTime = times[i]));
      await Promise.all(shown);
      return runs.count - before;
    };
    // The first of two together makes their session.
    await seek(0.5, 1.5);
    assertEqual(await seek(1, 2), 1, 'runs for both');
    assertEqual(
      elements.map((element) => element.currentTime),
      [1, 2],
    );
    elements[0].remove();
    elements.shift();
    await seek(3);
    assertEqual(elements[0].currentTime, 3);
  });
});
