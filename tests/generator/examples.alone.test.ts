/**
 * The trained examples of demo/generators: each keeps the contract, header and values, and its output on the CPU, drawn by our renderer, has the PSNR of its view.json against an image that it was not trained on.
 */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import * as ort from 'onnxruntime-web';
import { PNG } from 'pngjs';
import { checkModel } from '@gaussian-splat/check';
import { cameraFromCalibration } from '@gaussian-splat/core';
import { gaussianLayout, oneInstance, resolveContract } from '@gaussian-splat/core/contract';
import { bytesSource, readOnnxHeader } from '@gaussian-splat/core/onnx';
import {
  bindInputs,
  groupInstances,
  inputsOfInstances,
  stackInputs,
  type GeneratorState,
  type InputNumbers,
  type Inputs,
} from '@gaussian-splat/generator';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { onlyInLab } from '../support/extent.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { capture, Renderer } from '../support/renderer.js';

const root = fileURLToPath(new URL('../../demo/generators/', import.meta.url));
const names = readdirSync(root).filter((name) => existsSync(`${root}${name}/model.onnx`));
/**
 * Examples in `npm test`: one that only uses time and one that is posed. The laboratory runs the others, which were
 * trained.
 */
const DAILY: readonly string[] = ['skull', 'walker'];
/** Examples of networks that others trained: they have no record of a training. */
const UNTRAINED: readonly string[] = ['portrait'];
/** Allowed loss in dB for an image against the photograph, compared with the example's figure at its creation. */
const TOLERANCE_DB = 0.1;
const MAX_BYTES = 8e6;
/** GPUBufferUsage.STORAGE and COPY_DST: Node has no such global. */
const STORAGE_AND_COPY = 0x80 | 0x8;

/** Output of `example_view.py`, with the PSNR that the example reached. */
interface View {
  readonly width: number;
  readonly height: number;
  readonly K: number[][];
  readonly worldToCamera: number[][];
  readonly time?: number;
  readonly pose?: number[][];
  readonly shape?: number[];
  /** Image files that the example takes, by the names of its inputs. */
  readonly images?: Readonly<Record<string, string>>;
  readonly controls?: Readonly<Record<string, number[]>>;
  readonly fitGain: boolean;
  readonly psnr: number;
}

const read = (path: string): Uint8Array<ArrayBuffer> => new Uint8Array(readFileSync(root + path));
const readJson = (path: string): unknown => JSON.parse(readFileSync(root + path, 'utf8'));

test('there are examples of every kind that is said to ship', () => {
  const listed = readFileSync(`${root}README.md`, 'utf8');
  assert.ok(names.length >= 6, names.join());
  for (const name of names) assert.ok(listed.includes(`[${name}]`), `README.md has no row for ${name}`);
});

test('ten of the avatar that ships are one run', async () => {
  const header = await readOnnxHeader(bytesSource(read('walker/model.onnx')));
  const { contract } = resolveContract({ header });
  const one = oneInstance(header, contract);
  const [joints] = header.inputs.find(({ name }) => name === 'pose')!.dims!.slice(1) as number[];
  const ten = Array.from({ length: 10 }, (_, i) => ({
    inputs: bindInputs(one, contract, { pose: Array.from({ length: 3 * joints }, (__, k) => Math.sin(i + k)) }),
  }));
  const groups = groupInstances(ten, inputsOfInstances(header, contract), contract.instances!.most);
  assert.deepEqual(
    groups.map((group) => group.length),
    [10],
  );
});

const skipOf = (name: string): string | false => (DAILY.includes(name) ? false : onlyInLab);

for (const name of names) {
  test(
    `${name}: keeps the contract, in its header and in what it writes`,
    { timeout: 240_000, skip: skipOf(name) },
    async () => {
      const report = await checkModel(`${root}${name}/model.onnx`, { run: true });
      assert.deepEqual(report.faults, []);
      assert.deepEqual(report.warnings, []);
      assert.ok(read(`${name}/model.onnx`).length <= MAX_BYTES);
      if (UNTRAINED.includes(name)) return;
      const record = readJson(`${name}/record.json`) as Record<string, number>;
      // The diffusion model has a gain over noisy vessels instead; tests/test_diffusion.py of the exporter runs all its steps.
      const isGood = record.held_out_psnr > 20 || record['held_out_gain_db_at_0.5'] > 15;
      assert.ok(isGood && record.steps > 1000, 'trained, and measured on what it has not seen');
    },
  );

  if (!existsSync(`${root}${name}/view.json`)) continue;
  test(
    `${name}: draws a view that it has not seen as well as on the day it was made`,
    { timeout: 240_000, skip: skipOf(name) || (name === 'skull' && onlyInLab) },
    async () => {
      const view = readJson(`${name}/view.json`) as View;
      const drawn = await drawView(name, view);
      const wanted = PNG.sync.read(Buffer.from(read(`${name}/view.png`)));
      const decibels = outlinePsnr(drawn, wanted.data, view.fitGain);
      console.log(`${name}`.padEnd(10), `${decibels.toFixed(2)} dB`);
      assert.ok(Math.abs(decibels - view.psnr) < TOLERANCE_DB, `${decibels} dB, ${view.psnr} when it was made`);
    },
  );
}

/** Runs the example on the CPU for a view's camera, time, pose and shape, and draws its output: RGBA, premultiplied. */
async function drawView(name: string, view: View): Promise<Float32Array> {
  const bytes = read(`${name}/model.onnx`);
  const header = await readOnnxHeader(bytesSource(bytes));
  const { contract } = resolveContract({ header });
  const camera = cameraFromCalibration(view, `${name}/view.json`);
  const state: GeneratorState = {
    camera,
    timeSeconds: (view.time ?? 0) * (contract.duration ?? 0),
    ...(view.pose && { pose: view.pose.flat() }),
    ...(view.shape && { shape: view.shape }),
    ...(view.controls && { controls: view.controls }),
  };
  const images = Object.entries(view.images ?? {}).map(([input, file]) => [input, planes(read(`${name}/${file}`))]);
  const inputs = { ...bindInputs(oneInstance(header, contract), contract, state), ...Object.fromEntries(images) };
  const written = await run(bytes, stackInputs([inputs], inputsOfInstances(header, contract)));
  const device = await serialDevice();
  const layout = gaussianLayout(header, contract);
  assert.ok(layout, 'a model that writes Gaussians');
  const gaussians = await DynamicGaussians.create(device, layout, { antialiased: contract.antialiased });
  const buffers = Object.entries(written).map(([name, numbers]) => {
    const buffer = device.createBuffer({ size: numbers.byteLength, usage: STORAGE_AND_COPY });
    device.queue.writeBuffer(buffer, 0, numbers);
    return [name, buffer] as const;
  });
  gaussians.ingest(Object.fromEntries(buffers), gaussians.count);
  const renderer = new Renderer(device);
  const pixels = await capture(device, renderer, { gaussians, camera });
  renderer.destroy();
  gaussians.destroy();
  for (const [, buffer] of buffers) buffer.destroy();
  return pixels;
}

/** An image as a model takes it: red, green and blue one after the other. */
function planes(file: Uint8Array): InputNumbers {
  const { width, height, data } = PNG.sync.read(Buffer.from(file));
  const size = width * height;
  const numbers = Float32Array.from({ length: 3 * size }, (_, i) => data[4 * (i % size) + Math.floor(i / size)] / 255);
  return { dtype: 'float32', dims: [1, 3, height, width], data: numbers };
}

async function run(model: Uint8Array, inputs: Inputs): Promise<Record<string, Float32Array<ArrayBuffer>>> {
  ort.env.logLevel = 'error';
  ort.env.wasm.numThreads = 1;
  const session = await ort.InferenceSession.create(model, { executionProviders: ['wasm'], logSeverityLevel: 3 });
  const feeds: Record<string, ort.Tensor> = {};
  for (const [name, { data, dims }] of Object.entries(inputs as Record<string, InputNumbers>)) {
    feeds[name] = new ort.Tensor('float32', data as Float32Array, dims);
  }
  const results = await session.run(feeds);
  const written = Object.entries(results).map(
    ([name, { data }]) => [name, new Float32Array(data as Float32Array)] as const,
  );
  await session.release();
  return Object.fromEntries(written);
}

/** Decibels over the pixels that count, on black; with `fitGain` after the best gain for each channel, as of photographs. */
function outlinePsnr(drawn: Float32Array, wanted: Uint8Array, fitGain: boolean): number {
  const counted = Array.from({ length: wanted.length / 4 }, (_, i) => 4 * i).filter((i) => wanted[i + 3] === 255);
  let squares = 0;
  for (let channel = 0; channel < 3; channel++) {
    const found = counted.map((i) => drawn[i + channel]);
    const target = counted.map((i) => wanted[i + channel] / 255);
    const sum = (a: number[], b: number[]): number => a.reduce((total, x, i) => total + x * b[i], 0);
    const gain = fitGain ? sum(found, target) / sum(found, found) : 1;
    found.forEach((x, i) => (squares += (Math.min(Math.max(x * gain, 0), 1) - target[i]) ** 2));
  }
  return -10 * Math.log10(squares / (3 * counted.length));
}

after(endNodeDevice);
