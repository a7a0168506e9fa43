/**
 * The profile "Safari 26": a device without `adapterInfo`, without features and with the default limits of WebGPU, and no
 * JSPI. Every family runs there many times, and neither the memory of the runtime, of scripts nor of the GPU grows.
 */
import { Generator, PostProcessor, type GeneratorModel, type GeneratorState } from '@gaussian-splat/generator';
import { ImageTensor } from '@gaussian-splat/renderer';
import { executeServerCommand } from '@web/test-runner-commands';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { holdings } from '../../element/browser/support/ledger.js';
import { isFull, isLab } from '../../support/extent-in-pages.js';
import { CAMERA } from './support.js';

const FAMILIES = [
  'hexplane',
  ...(isLab
    ? [
        'scaffold',
        'octree-round',
        'classic-view',
        'avatar',
        'feed-forward-1',
        'octree-progressive',
        'octree-ceil',
        'feed-forward-2',
      ]
    : []),
  ...(isLab ? ['spacetime', 'deformable', '4dgs', 'avatar-instances', 'hexplane-instances', 'style', 'noise'] : []),
];
const POST_PROCESSORS = ['style', 'noise'];
/** Runs after which memory is compared; the first ones fill the caches of the runtime. */
const [FIRST_RUNS, RUNS] = isFull ? [500, 10_000] : isLab ? [200, 1_000] : [30, 60];
/**
 * The same for families whose shaders have barriers for groups of more than 64 lanes, on SwiftShader. Each of its threads keeps a stack for every four lanes that waited at a barrier. A stack is
 * three memory maps, and a process has 65,530: 16 threads have 37,000 after 120 runs of `feed-forward-1`.
 */
const [FIRST_FIBERS, FIBERS] = [10, 40];
/** Bytes of scripts that may remain of all runs. Of 100 runs 50 to 150 kB do, and 23 to 231 kB of 1,000: a constant, and no object for each run. */
const MAX_HEAP = 512_000;

/** Memories of the WebAssembly modules of this page. */
const memories: WebAssembly.Memory[] = [];

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
}

let device: GPUDevice;
let isSoftware = false;
/** Whether SwiftShader runs shaders with barriers for large groups in this family. */
let hasFibers = false;

function watchBarriers(): void {
  const { createShaderModule } = GPUDevice.prototype;
  GPUDevice.prototype.createShaderModule = function (descriptor) {
    const { code } = descriptor;
    const sizes = [...code.matchAll(/\bworkgroup_size_[xyz]: u32 = (\d+)/g)].map(([, size]) => Number(size));
    const lanes = sizes.reduce((product, size) => product * size, 1);
    hasFibers ||= isSoftware && lanes > 64 && code.includes('workgroupBarrier(');
    return createShaderModule.call(this, descriptor);
  };
}

before(() => {
  removeWhatSafariLacks();
  watchMemory();
  watchBarriers();
});

// A device for each family: a GPU process that ends ends the runs of one.
beforeEach(async () => {
  const adapter = (await navigator.gpu.requestAdapter())!;
  isSoftware = adapter.info.architecture === 'swiftshader';
  hasFibers = false;
  device = await adapter.requestDevice();
  assertEqual(device.adapterInfo as GPUAdapterInfo | undefined, undefined, 'adapterInfo of the profile');
});
afterEach(() => device.destroy());

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

/** A generator or a post-processor that runs once for each state. */
interface Repeated {
  readonly model: GeneratorModel;
  run(state: GeneratorState): Promise<void>;
  close(): Promise<void>;
}

async function open(name: string, onRun: () => void, onProblem: (problem: unknown) => void): Promise<Repeated> {
  const source = { url: `/tests/fixtures/families/${name}.onnx` };
  const options = { gpuCheck: false, onFallback: onProblem, onError: onProblem };
  if (!POST_PROCESSORS.includes(name)) {
    const generator = await Generator.open(source, device, options);
    generator.sink = { ingest: onRun };
    const run = (state: GeneratorState): Promise<void> => (generator.request(state), generator.idle);
    return { model: generator.model, run, close: () => (generator.close(), generator.idle) };
  }
  const post = await PostProcessor.open(source, device, { ...options, onImage: onRun });
  const run = (state: GeneratorState): Promise<void> => (
    post.request(state.images![post.input.name], state),
    post.idle
  );
  return { model: post.models[0], run, close: () => (post.close(), post.idle) };
}

describe('the profile "Safari 26"', () => {
  for (const name of FAMILIES) {
    it(`${name}: many runs on the GPU, and no memory grows`, async () => {
      const problems: unknown[] = [];
      let runs = 0;
      const count = (): void => void runs++;
      const repeated = await open(name, count, (problem) => problems.push(problem));
      const images = imagesOf(repeated.model);
      const runAt = async (step: number): Promise<void> => {
        for (const image of Object.values(images)) {
          const pixels = new ImageData(image.dims.at(-1)!, image.dims.at(-2)!);
          pixels.data.fill(step % 256);
          const bitmap = await createImageBitmap(pixels);
          image.upload(bitmap);
          bitmap.close();
        }
        await repeated.run(stateAt(repeated.model, step, images));
      };
      const heap = async (): Promise<number> => {
        await device.queue.onSubmittedWorkDone();
        return executeServerCommand<number, undefined>('heap-size');
      };
      for (let step = 0; step < FIRST_FIBERS; step++) await runAt(step);
      const [first, all] = hasFibers ? [FIRST_FIBERS, FIBERS] : [FIRST_RUNS, RUNS];
      for (let step = FIRST_FIBERS; step < first; step++) await runAt(step);
      const heapBefore = await heap();
      assert(memories.length > 0, 'the memory of the runtime');
      const sizes = (): unknown[] => [memories.map(({ buffer }) => buffer.byteLength), holdings()];
      const before = sizes();
      for (let step = 0; step < all; step++) await runAt(step + first);
      const heapAfter = await heap();
      assertEqual(problems.map(String), [], 'fallbacks and errors');
      assertEqual(runs, first + all, 'runs');
      assertEqual(sizes(), before, 'bytes of the runtime, GPU buffers and textures, and their bytes');
      const left = heapAfter - heapBefore;
      console.log(`${name}: ${left} bytes of scripts after ${all} runs, ${JSON.stringify(before)}`);
      assert(left <= MAX_HEAP, `${left} bytes of scripts remain of ${all} runs`);
      await repeated.close();
    });
  }
});
