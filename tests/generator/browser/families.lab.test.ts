/** One small file of every family that the exporter writes (packages/exporter/tests/write_zoo.py): the GPU against the CPU, in numbers and in images. */
import { numberToHalf } from '@gaussian-splat/core';
import { DynamicGaussians, ImageTensor } from '@gaussian-splat/renderer';
import {
  Generator,
  openModel,
  PostProcessor,
  type GeneratorModel,
  type GeneratorState,
  type GpuTensor,
} from '@gaussian-splat/generator';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { isLab } from '../../support/extent-in-pages.js';
import { calls, CAMERA, makeDevice, numbersOf, readBuffer, ReadingSink, relativeError, runOnCpu } from './support.js';
import { capture, Renderer } from '../../support/renderer.js';

const FAMILIES = '/tests/fixtures/families/';
const RELATIVE_ERROR = 1e-3;
const RELATIVE_ERROR_OF_HALVES = 5e-3;
const DECIBELS = 55;

/** One of every kind; what differs little from one of these is the exporter's breadth. */
const GENERATORS = [
  ...['classic-view', 'octree-round', 'hexplane', 'avatar', 'feed-forward-1'],
  ...(isLab ? ['classic', 'scaffold', 'octree-progressive', 'octree-ceil', 'feed-forward-2'] : []),
  ...(isLab ? ['spacetime', 'deformable', '4dgs'] : []),
];

/** The same, writing float16. */
const HALVES = ['classic', 'classic-view', 'scaffold', 'octree-round', 'hexplane', 'avatar', 'feed-forward-1'].map(
  (name) => `${name}-half`,
);

let device: GPUDevice;
const images = new Map<string, ImageTensor>();

/** A state that differs with `step`: another camera, time, pose and image. */
async function stateAt({ header, contract }: GeneratorModel, step: number): Promise<GeneratorState> {
  const sizeOf = (name: string): number =>
    (header.inputs.find((input) => input.name === name)?.dims ?? []).reduce<number>((n, dim) => n * Number(dim), 1);
  const wave = (name: string, share: number): number[] =>
    Array.from({ length: sizeOf(name) }, (_, i) => share * Math.sin(1.7 * i + step));
  const state: { -readonly [K in keyof GeneratorState]: GeneratorState[K] } = {
    camera: {
      ...CAMERA,
      worldToCamera: [1, 0, 0, -0.1 * step, 0, 1, 0, 0.05 * step, 0, 0, 1, 4 + 0.1 * step, 0, 0, 0, 1],
    },
    timeSeconds: ((0.3 + 0.37 * step) % 1) * (contract.duration ?? 1),
  };
  const given: Record<string, GpuTensor> = {};
  for (const [name, { role }] of Object.entries(contract.inputs)) {
    if (role === 'pose') state.pose = wave(name, 0.4);
    if (role === 'shape') state.shape = wave(name, 0.5);
    if (role === 'image') given[name] = await imageFor(name, header, step);
  }
  return { ...state, images: given };
}

async function imageFor(name: string, { inputs }: GeneratorModel['header'], step: number): Promise<ImageTensor> {
  const [height, width] = inputs
    .find((input) => input.name === name)!
    .dims!.slice(2)
    .map(Number);
  const key = `${name} ${width} ${height}`;
  const tensor = images.get(key) ?? new ImageTensor(device, { width, height, dtype: 'float32' });
  images.set(key, tensor);
  const pixels = new Uint8ClampedArray(4 * width * height).map((_, i) =>
    i % 4 === 3 ? 255 : 128 + 120 * Math.sin(0.13 * i + step + name.length),
  );
  tensor.upload(await createImageBitmap(new ImageData(pixels, width, height)));
  return tensor;
}

async function onCpu(url: string, { images: given = {}, ...state }: GeneratorState) {
  const numbers: Record<string, { dims: readonly number[]; data: Float32Array }> = {};
  for (const [name, { buffer, dims }] of Object.entries(given)) {
    const size = dims.reduce((product, dim) => product * dim, 1);
    numbers[name] = { dims, data: new Float32Array((await readBuffer(device, buffer)).buffer as ArrayBuffer, 0, size) };
  }
  return runOnCpu(url, state, numbers);
}

const decibelsOf = (found: ArrayLike<number>, expected: ArrayLike<number>): number => {
  let squares = 0;
  for (let i = 0; i < expected.length; i++) squares += (found[i] - expected[i]) ** 2;
  return Math.min(200, -10 * Math.log10(squares / expected.length));
};

const isConstant = ({ model }: Generator): boolean => model.header.inputs.length === 0;

describe('every family on the GPU', () => {
  before(async () => {
    device = await makeDevice(['shader-f16']);
  });

  for (const name of [...GENERATORS, ...HALVES]) {
    it(`${name}: the CPU's numbers, the CPU's image, and no allocation on the frame path`, async function () {
      const isHalf = HALVES.includes(name);
      if (isHalf && !device.features.has('shader-f16')) {
        console.log(`${name}: not run, this adapter has no shader-f16`);
        return this.skip();
      }
      const url = `${FAMILIES}${name}.onnx`;
      const generator = await Generator.open({ url }, device, { onError: reportError });
      const { layout } = generator.model;
      const sink = (generator.sink = new ReadingSink(device));
      let worst = 0;
      let expected: Awaited<ReturnType<typeof onCpu>> = {};
      let state: GeneratorState = {};
      for (let step = 0; step < (isConstant(generator) ? 1 : 2); step++) {
        state = await stateAt(generator.model, step);
        generator.request(state);
        await generator.idle;
        assertEqual(sink.runs.length, step + 1, 'runs');
        expected = await onCpu(url, state);
        for (const { tensor, offset, components, rowStride } of layout.attributes) {
          const of = (values: readonly number[]): number[] =>
            values.filter((_, i) => i % rowStride >= offset && i % rowStride < offset + components);
          const { values } = expected[tensor];
          const found = numbersOf(await sink.runs[step].tensors[tensor], layout.dtype).slice(0, values.length);
          worst = Math.max(worst, relativeError(of(found), of(values)));
        }
      }
      const decibels = await compareFrames(generator, expected, state);
      await assertNothingMade(generator);
      console.log(`${name}: ${generator.kind}, relative error ${worst.toExponential(1)}, ${decibels.toFixed(1)} dB`);
      assert(generator.kind !== 'wasm', 'on the GPU');
      assert(worst <= (isHalf ? RELATIVE_ERROR_OF_HALVES : RELATIVE_ERROR), `relative error ${worst}`);
      assert(decibels >= DECIBELS, `${decibels} dB`);
      generator.close();
    });
  }

  for (const name of ['style', 'noise']) {
    it(`${name}: the CPU's image, and no allocation on the frame path`, async () => {
      const url = `${FAMILIES}${name}.onnx`;
      let found: Promise<Uint8Array> | undefined;
      let isReading = true;
      let runs = 0;
      const post = await PostProcessor.open({ url }, device, {
        onError: reportError,
        onImage: ({ buffer }) => {
          runs++;
          if (isReading) found = readBuffer(device, buffer);
        },
      });
      const [model] = post.models;
      let [error, decibels] = [0, 200];
      const ask = async (step: number): Promise<GeneratorState> => {
        const state = await stateAt(model, step);
        post.request(state.images![post.input.name], state);
        await post.idle;
        return state;
      };
      for (let step = 0; step < 3; step++) {
        const state = await ask(step);
        const [{ values }] = Object.values(await onCpu(url, state));
        assert(found, 'an image');
        const numbers = numbersOf(await found, 'float32').slice(0, values.length);
        error = Math.max(error, relativeError(numbers, values));
        decibels = Math.min(decibels, decibelsOf(numbers, values));
      }
      isReading = false;
      for (let step = 3; step < 6; step++) await ask(step);
      const { createBuffer, mapAsync } = calls;
      for (let step = 6; step < 16; step++) await ask(step);
      assertEqual([runs, calls.createBuffer, calls.mapAsync], [16, createBuffer, mapAsync], 'runs and calls');
      console.log(`${name}: ${post.kind}, relative error ${error.toExponential(1)}, ${decibels.toFixed(1)} dB`);
      assert(error <= RELATIVE_ERROR && decibels >= DECIBELS, `relative error ${error}, ${decibels} dB`);
      post.close();
    });
  }
});

/** The frame drawn live against the frame drawn from the CPU's numbers, dB before rounding. */
async function compareFrames(
  generator: Generator,
  expected: Awaited<ReturnType<typeof onCpu>>,
  state: GeneratorState,
): Promise<number> {
  const { layout } = generator.model;
  const renderer = new Renderer(device);
  const live = await DynamicGaussians.create(device, layout);
  const fromCpu = await DynamicGaussians.create(device, layout);
  // Its own instance: a model without inputs does not write its outputs again.
  const instance = await Generator.open({ url: generator.model.url }, device, { onError: reportError });
  instance.sink = live;
  instance.request(await stateAt(generator.model, 9));
  await instance.idle;
  instance.request({ ...state, images: (await stateAt(generator.model, isConstant(generator) ? 0 : 1)).images });
  await instance.idle;
  instance.close();
  fromCpu.ingest(uploaded(expected, layout.dtype === 'float16'), layout.capacity);
  const { center, radius } = await fromCpu.readBounds();
  const [x, y, z] = center;
  const camera = { ...CAMERA, worldToCamera: [1, 0, 0, -x, 0, 1, 0, -y, 0, 0, 1, 2.5 * radius - z, 0, 0, 0, 1] };
  const frames = [];
  for (const gaussians of [live, fromCpu]) frames.push(await capture(device, renderer, { gaussians, camera }));
  const covered = frames[1].filter((value, i) => i % 4 === 3 && value > 0.05).length;
  assert(covered > 50, `${covered} pixels are covered`);
  for (const made of [live, fromCpu, renderer]) made.destroy();
  return decibelsOf(frames[0], frames[1]);
}

function uploaded(outputs: Awaited<ReturnType<typeof onCpu>>, isHalf: boolean): Record<string, GPUBuffer> {
  return Object.fromEntries(
    Object.entries(outputs).map(([name, { values }]) => {
      const numbers = isHalf ? Uint16Array.from(values, numberToHalf) : Float32Array.from(values);
      // Writes are of whole words.
      const bytes = new Uint8Array(4 * Math.ceil(numbers.byteLength / 4));
      bytes.set(new Uint8Array(numbers.buffer));
      const buffer = device.createBuffer({ size: bytes.length, usage: 0x80 | 0x8 | 0x4 });
      device.queue.writeBuffer(buffer, 0, bytes);
      return [name, buffer];
    }),
  );
}

/** Runs for five more states, and the GPU objects made meanwhile. */
async function assertNothingMade(generator: Generator): Promise<void> {
  if (isConstant(generator)) return;
  const gaussians = await DynamicGaussians.create(device, generator.model.layout);
  generator.sink = gaussians;
  const states: GeneratorState[] = [];
  for (let step = 10; step < 18; step++) states.push(await stateAt(generator.model, step));
  // Images use one tensor, which changes with every upload: only the last of them is new to the model.
  for (const state of states.slice(0, 3)) await ask(generator, state);
  const { runs } = generator;
  const { createBuffer, mapAsync } = calls;
  for (const state of states.slice(3)) await ask(generator, state);
  assertEqual([calls.createBuffer, calls.mapAsync], [createBuffer, mapAsync], 'calls of warm runs');
  const takesMore = Object.values(generator.model.contract.inputs).some(
    ({ role }) => role !== 'image' && role !== 'control',
  );
  assert(!takesMore || generator.runs === runs + 5, `${generator.runs - runs} runs`);
  gaussians.destroy();
}

async function ask(generator: Generator, state: GeneratorState): Promise<void> {
  generator.request(state);
  await generator.idle;
}

it('every file keeps its contract', async () => {
  for (const name of [...GENERATORS, ...HALVES, 'style', 'noise']) await openModel({ url: `${FAMILIES}${name}.onnx` });
});
