/** A page draws the model's values: the first run on the GPU is compared with the CPU, which replaces a wrong GPU. */
import { Generator, type GeneratorOptions } from '@gaussian-splat/generator';
import { acquireSession } from '@gaussian-splat/generator';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { itInLab, someOf } from '../../support/extent-in-pages.js';
import { CAMERA, FIXTURES, makeDevice, numbersOf, ReadingSink, relativeError, runOnCpu } from './support.js';

let device: GPUDevice;
before(async () => {
  device = await makeDevice();
});
beforeEach(() => localStorage.clear());

const STATE = { timeSeconds: 1 };
const until = async (isTrue: () => boolean, ms = 300_000): Promise<void> => {
  for (const end = performance.now() + ms; !isTrue() && performance.now() < end;)
    await new Promise((go) => setTimeout(go, 20));
};

/** A generator at one second, its messages, and its sink. */
async function opened(url: string, options: GeneratorOptions = {}, on = device) {
  const reasons: string[] = [];
  const sink = new ReadingSink(on);
  const onFallback = (reason: string): void => void reasons.push(reason);
  const generator = await Generator.open({ url }, on, { onError: reportError, onFallback, ...options });
  generator.sink = sink;
  generator.request(STATE);
  await generator.idle;
  return { generator, reasons, sink };
}

/** Worst error of positions and colors, as a fraction of the largest, of the last run. */
async function errorOf(url: string, sink: ReadingSink): Promise<number> {
  const wanted = await runOnCpu(url, STATE);
  const last = sink.runs.at(-1)!;
  const errors = ['positions', 'colors'].map(async (name) => {
    const { values } = wanted[name];
    return relativeError(numbersOf(await last.tensors[name], 'float32').slice(0, values.length), values);
  });
  return Math.max(...(await Promise.all(errors)));
}

const FORMS = 'constant cast dequantized identity reshaped transposed strided line grouped pointwise'.split(' ');
for (const form of someOf(FORMS, 3)) {
  it(`spelled-${form}: the right numbers from the first frame on`, async () => {
    const url = `${FIXTURES}spelled-${form}.onnx`;
    const { generator, reasons, sink } = await opened(url, { gpuCheck: false });
    const error = await errorOf(url, sink);
    assert(error < 1e-3, `relative error ${error}`);
    const isRight = form === 'grouped' || form === 'pointwise';
    assertEqual([generator.kind, reasons.length], [isRight ? 'captured' : 'wasm', isRight ? 0 : 1], reasons.join());
    generator.close();
  });
}

itInLab("the position of a camera, -(R^T t), is the file's, for any optimization of the runtime", async () => {
  const url = `${FIXTURES}spelled-eye.onnx`;
  const c = Math.cos(1);
  const s = Math.sin(1);
  const worldToCamera = [c, 0, s, 1, 0, 1, 0, 2, -s, 0, c, 5, 0, 0, 0, 1] as const;
  const eye = [-(c * 1 - s * 5), -2, -(s * 1 + c * 5)].map((x) => -0.1 * x);
  const sink = new ReadingSink(device);
  const generator = await Generator.open({ url }, device, { onError: reportError, gpuCheck: false });
  generator.sink = sink;
  for (const matrix of [CAMERA.worldToCamera, worldToCamera]) {
    generator.request({ camera: { ...CAMERA, worldToCamera: matrix } });
    await generator.idle;
  }
  const [rest, turned] = await Promise.all(
    sink.runs.map(async ({ tensors }) => numbersOf(await tensors.positions, 'float32')),
  );
  // At the first camera R is 1, and the place is (0, 0, -4).
  const moved = [0, 1, 2].map((i) => turned[i] - rest[i] + [0, 0, 0.4][i]);
  for (const i of [0, 1, 2]) assert(Math.abs(moved[i] - eye[i]) < 1e-4, `${moved.join(' ')} is not ${eye.join(' ')}`);
  generator.close();
});

it('an unlisted fault is found by the comparison: the model continues on the CPU, with the reason, and the visible frame is computed again', async () => {
  const url = `${FIXTURES}spelled-hidden.onnx`;
  const { generator, reasons, sink } = await opened(url);
  assertEqual([generator.kind, sink.runs.length], ['captured', 1], 'the first run');
  assert((await errorOf(url, sink)) > 0.1, 'the GPU is right by now: then this fixture proves nothing');
  await until(() => sink.runs.length > 1);
  assertEqual(generator.kind, 'wasm', 'how it runs then');
  assert(/other numbers than the CPU: .* differ by/.test(reasons.join()), reasons.join());
  assertEqual(reasons.length, 1, 'reasons');
  assert((await errorOf(url, sink)) < 1e-6, 'the second run');
  generator.close();
  // The record: another visit does not begin wrong.
  const again = await opened(url, {}, await makeDevice());
  assertEqual([again.generator.kind, again.reasons.length], ['wasm', 1], 'the next visit');
  again.generator.close();
});

it('a right model stays on the GPU, is compared once for a model and adapter, and can be left alone', async () => {
  const url = `${FIXTURES}packed.onnx`;
  const workers = countWorkers();
  const source = { url };
  for (const [compare, expected] of [
    [false, 0],
    [true, 1],
    [true, 1],
  ] as const) {
    const own = await makeDevice();
    const lease = await acquireSession(source, own, { gpuCheck: compare });
    await lease.session.run(lease.session.bind(STATE), () => undefined);
    if (compare) await until(() => lease.session.verdict !== undefined);
    else await new Promise((go) => setTimeout(go, 3000));
    assertEqual(workers.count, expected, `workers with compare ${compare}`);
    assertEqual(lease.session.verdict?.result, compare ? 'same' : undefined, lease.session.verdict?.reason ?? '');
    assert(!compare || lease.session.verdict!.error! < 1e-3, lease.session.verdict?.reason ?? '');
    lease.release();
  }
  workers.restore();
});

itInLab('a model with a state is compared with its first state, which the first run replaces', async () => {
  const { generator, reasons } = await opened(`${FIXTURES}state.onnx`);
  const records = (): string[] =>
    Object.values(localStorage).map((text) => (JSON.parse(text) as { result: string }).result);
  await until(() => records().length > 0);
  assertEqual([records(), reasons, generator.kind], [['same'], [], 'captured']);
  generator.close();
});

itInLab('a page that forbids workers continues as before', async () => {
  const workers = countWorkers(() => {
    throw new Error('no workers here');
  });
  const lease = await acquireSession({ url: `${FIXTURES}heavy.onnx` }, device);
  await lease.session.run(lease.session.bind(STATE), () => undefined);
  await until(() => lease.session.verdict !== undefined);
  assertEqual(lease.session.verdict?.result, 'unknown', 'verdict');
  assert(/no workers here/.test(lease.session.verdict!.reason), lease.session.verdict!.reason);
  assertEqual(lease.session.kind, 'captured', 'kind');
  lease.release();
  workers.restore();
});

function countWorkers(before: () => void = () => undefined) {
  const Original = globalThis.Worker;
  const counter = { count: 0, restore: () => void (globalThis.Worker = Original) };
  globalThis.Worker = class extends Original {
    constructor(...given: ConstructorParameters<typeof Worker>) {
      before();
      super(...given);
      counter.count++;
    }
  };
  return counter;
}
