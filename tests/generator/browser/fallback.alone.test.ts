/** Software GPUs and runs that take too long: which models run on the CPU then, and the reason that a page is given. */
import { ImageTensor } from '@gaussian-splat/renderer';
import { Generator, setRunLimit } from '@gaussian-splat/generator';
import type * as LoadRuntime from '../../../packages/generator/dist/runtime/load-runtime.js';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { CAMERA, FIXTURES, makeDevice, ReadingSink } from './support.js';

const BUILT = '/packages/generator/dist/runtime/load-runtime.js';

/** Runs a model once. @returns The kind of its session, the reasons of fallbacks, and its errors. */
async function runOf(
  name: string,
  device: GPUDevice,
): Promise<{ kind: unknown; reasons: string[]; errors: unknown[] }> {
  const reasons: string[] = [];
  const errors: unknown[] = [];
  const generator = await Generator.open({ url: `${FIXTURES}${name}` }, device, {
    gpuCheck: false,
    onFallback: (reason) => reasons.push(reason),
    onError: (error) => errors.push(error),
  });
  const sink = (generator.sink = new ReadingSink(device));
  const image = new ImageTensor(device, { width: 8, height: 8, dtype: 'float32' });
  image.upload(new OffscreenCanvas(8, 8).getContext('2d')!.canvas);
  generator.request({ camera: CAMERA, images: { image } });
  await generator.idle;
  assertEqual(sink.runs.length, 1, `runs of ${name}`);
  const { kind } = generator;
  generator.close();
  return { kind, reasons, errors };
}

/** A device whose adapter is software or hardware, as a test says. */
async function deviceOf(isFallbackAdapter: boolean): Promise<GPUDevice> {
  const device = await makeDevice();
  const { vendor, architecture, subgroupMinSize, subgroupMaxSize } = device.adapterInfo;
  const info = { vendor, architecture, subgroupMinSize, subgroupMaxSize, device: '', description: '' };
  Object.defineProperty(device, 'adapterInfo', { value: { ...info, isFallbackAdapter } });
  return device;
}

it('a software GPU leaves models of images to the CPU, and keeps those that run in each frame', async () => {
  const software = await deviceOf(true);
  const still = await runOf('picture.onnx', software);
  assertEqual([still.kind, still.reasons.length].join(), 'wasm,1', 'a model of images');
  assert(/no hardware GPU/.test(still.reasons[0]), still.reasons[0]);
  assertEqual((await runOf('packed.onnx', software)).kind, 'captured', 'a model of the time');
  assertEqual((await runOf('picture.onnx', await deviceOf(false))).kind, 'webgpu', 'a model of images on hardware');
});

itInLab('a model whose first run on the GPU takes too long runs on the CPU', async () => {
  const { ort } = await ((await import(BUILT)) as typeof LoadRuntime).loadRuntime();
  const { create } = ort.InferenceSession;
  // The GPU of this copy of the runtime never finishes; the next copy is as it should be.
  ort.InferenceSession.create = async (...given: never[]) =>
    Object.assign(await (create as (...all: never[]) => ReturnType<typeof create>)(...given), {
      run: () => new Promise<never>(() => undefined),
    });
  setRunLimit(3000);
  const { kind, reasons, errors } = await runOf('packed.onnx', await deviceOf(false));
  setRunLimit(120_000);
  assertEqual([kind, reasons.length, errors.length].join(), 'wasm,1,0', String(errors[0]));
  assert(/no result within 3000 ms/.test(reasons[0]), reasons[0]);
});

it('a crash of the runtime is a reason that people can read, and the model runs on the CPU', async () => {
  const { ort } = await ((await import(BUILT)) as typeof LoadRuntime).loadRuntime();
  ort.InferenceSession.create = () => Promise.reject(new WebAssembly.RuntimeError('unreachable'));
  const { kind, reasons } = await runOf('packed.onnx', await deviceOf(false));
  assertEqual([kind, reasons.length].join(), 'wasm,1', 'the next copy of the runtime');
  assert(/has stopped in this browser \(unreachable\); a newer version of the browser/.test(reasons[0]), reasons[0]);
});
