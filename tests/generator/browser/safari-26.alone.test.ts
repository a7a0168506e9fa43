/**
 * The profile "Safari 26": a device without `adapterInfo`, without features and with the default limits of WebGPU, and no
 * JSPI. Every family runs there many times, and neither the memory of the runtime nor that of the GPU grows.
 */
import { Generator, type GeneratorModel, type GeneratorState } from '@gaussian-splat/generator';
import { ImageTensor } from '@gaussian-splat/renderer';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { isLab } from '../../support/extent-in-pages.js';
import { CAMERA } from './support.js';

const FAMILIES = [
  ...['scaffold', 'octree-round', 'hexplane'],
  ...(isLab ? ['classic-view', 'avatar', 'feed-forward-1', 'octree-progressive', 'octree-ceil', 'feed-forward-2'] : []),
];
/** Runs after which memory is compared; the first ones fill the caches of the runtime. */
const [FIRST_RUNS, RUNS] = [50, isLab ? 10_000 : 100];

/** Memories of the WebAssembly modules of this page. */
const memories: WebAssembly.Memory[] = [];
/** Bytes of the GPU buffers that exist, by the browser's own calls. */
const ledger = { buffers: 0, bytes: 0 };

function removeWhatSafariLacks(): void {
  const own = WebAssembly as unknown as Record<string, unknown>;
  for (const name of ['Suspending', 'promising', 'Suspender', 'SuspendError']) delete own[name];
  Object.defineProperty(GPUDevice.prototype, 'adapterInfo', { get: () => undefined, configurable: true });
}

function watchMemory(): void {
  const { instantiate } = WebAssembly;
  WebAssembly.instantiate = (async (...given: Parameters<typeof instantiate>) => {
    const made = (await instantiate(...given)) as unknown as WebAssembly.WebAssemblyInstantiatedSource;
    const { exports } = 'instance' in made ? made.instance : (made as unknown as WebAssembly.Instance);
    memories.push(...Object.values(exports).filter((each) => each instanceof WebAssembly.Memory));
    const imported = Object.values((given[1] ?? {}) as WebAssembly.Imports).flatMap(Object.values<unknown>);
    memories.push(...imported.filter((each) => each instanceof WebAssembly.Memory));
    return made;
  }) as unknown as typeof instantiate;
  const { createBuffer } = GPUDevice.prototype;
  const { destroy } = GPUBuffer.prototype;
  const gone = new WeakSet<GPUBuffer>();
  GPUDevice.prototype.createBuffer = function counted(this: GPUDevice, descriptor) {
    ledger.buffers++;
    ledger.bytes += descriptor.size;
    return createBuffer.call(this, descriptor);
  };
  GPUBuffer.prototype.destroy = function counted(this: GPUBuffer) {
    if (!gone.has(this)) {
      ledger.buffers--;
      ledger.bytes -= this.size;
    }
    gone.add(this);
    return destroy.call(this);
  };
}

let device: GPUDevice;

before(async () => {
  removeWhatSafariLacks();
  watchMemory();
  device = await (await navigator.gpu.requestAdapter())!.requestDevice();
  assertEqual(device.adapterInfo as GPUAdapterInfo | undefined, undefined, 'adapterInfo of the profile');
});

/** A state whose inputs differ from those of the step before. */
function stateAt({ header, contract }: GeneratorModel, step: number, images: GeneratorState['images']): GeneratorState {
  const sizes = (role: string): number =>
    header.inputs
      .filter(({ name }) => contract.inputs[name].role === role)
      .reduce((sum, { dims = [] }) => sum + dims.reduce<number>((size, dim) => size * Number(dim), 1), 0);
  const wave = (size: number): number[] => Array.from({ length: size }, (_, i) => 0.3 * Math.sin(1.7 * i + step));
  return {
    camera: { ...CAMERA, worldToCamera: [1, 0, 0, 0.01 * (step % 50), 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1] },
    timeSeconds: ((step % 97) / 97) * (contract.duration ?? 1),
    pose: sizes('pose') > 0 ? wave(sizes('pose')) : undefined,
    shape: sizes('shape') > 0 ? wave(sizes('shape')) : undefined,
    images,
  };
}

function imagesOf({ header, contract }: GeneratorModel): Record<string, ImageTensor> {
  const inputs = header.inputs.filter(({ name }) => contract.inputs[name].role === 'image');
  return Object.fromEntries(
    inputs.map(({ name, dims = [] }) => {
      const [height, width] = dims.slice(-2).map(Number);
      return [name, new ImageTensor(device, { width, height, dtype: 'float32' })];
    }),
  );
}

describe('the profile "Safari 26"', () => {
  for (const name of FAMILIES) {
    it(`${name}: ${RUNS} runs on the GPU, and no memory grows`, async () => {
      const problems: unknown[] = [];
      const generator = await Generator.open({ url: `/tests/fixtures/families/${name}.onnx` }, device, {
        gpuCheck: false,
        onFallback: (reason) => problems.push(reason),
        onError: (error) => problems.push(error),
      });
      let runs = 0;
      generator.sink = { ingest: () => void runs++ };
      const images = imagesOf(generator.model);
      const run = async (step: number): Promise<void> => {
        for (const image of Object.values(images)) {
          const pixels = new ImageData(image.dims.at(-1)!, image.dims.at(-2)!);
          pixels.data.fill(step % 256);
          image.upload(await createImageBitmap(pixels));
        }
        generator.request(stateAt(generator.model, step, images));
        await generator.idle;
      };
      for (let step = 0; step < FIRST_RUNS; step++) await run(step);
      await device.queue.onSubmittedWorkDone();
      assert(memories.length > 0, 'the memory of the runtime');
      const sizes = (): number[] => [...memories.map(({ buffer }) => buffer.byteLength), ledger.buffers, ledger.bytes];
      const before = sizes();
      for (let step = 0; step < RUNS; step++) await run(step + FIRST_RUNS);
      await device.queue.onSubmittedWorkDone();
      assertEqual(problems.map(String), [], 'fallbacks and errors');
      assertEqual(runs, FIRST_RUNS + RUNS, 'runs');
      assertEqual(sizes(), before, 'bytes of the runtime, GPU buffers and their bytes');
      generator.close();
      await generator.idle;
    });
  }
});
