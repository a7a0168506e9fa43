import { boundsOf, GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import {
  LoadBudget,
  applyMotion,
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  readMotion,
  readScene,
  upright,
  type AnimatedAttributeName,
} from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import { GpuEvaluator } from '../gpu/gpu-evaluator.js';
import { decibels, mean, meanSquareOf } from '../measure.js';
import type { Deflate } from '../pages/page-planes.js';
import { splatsOf } from '../reduce.js';
import { findSteps, scaledSteps, type Steps } from '../steps.js';
import { viewsAround } from '../views.js';
import type { EncodeWebp } from '../write/sog.js';
import { tuneSog } from '../write/tune-sog.js';
import { alignAxes } from './near-axes.js';
import { writeMotion, type MotionSteps } from './write-motion.js';

export interface CodeSequenceOptions {
  readonly frameCount: number;
  /** Reads a frame by its index. All frames must have the same splats in the same order. */
  readonly openFrame: (frame: number) => Promise<GaussianCloud>;
  readonly framesPerFile: number;
  /** Target PSNR of frames against their sources in dB, over covered pixels. */
  readonly minPsnr: number;
  readonly device: GPUDevice;
  readonly encodeWebp: EncodeWebp;
  readonly deflate: Deflate;
  /** Compresses temporary files that are only measured; default `deflate`. */
  readonly deflateQuickly?: Deflate;
  /** Called with a sentence about each step. */
  readonly onStep?: (step: string) => void;
}

export interface CodedSequence {
  /** First frame as SOG. */
  readonly first: Uint8Array<ArrayBuffer>;
  /** Motion files with `framesPerFile` frames each; the last may have fewer. */
  readonly files: readonly Uint8Array<ArrayBuffer>[];
  /** PSNR of all measured frames together in dB. */
  readonly psnr: number;
  /** PSNR of the view with the largest error in dB. */
  readonly worstPsnr: number;
}

/** Fraction of the allowed error that the first frame may cause; motion may cause the rest. */
const FIRST_SHARE = 0.5;
const MAX_TRIES = 4;
const NEAR_ENOUGH = 0.85;
/** Approximate number of frames that are measured in the written files. */
const JUDGED = 3;

/**
 * Encodes a sequence whose frames have corresponding splats, as a scene of the first frame and motion files. Quantization
 * is as coarse as `minPsnr` allows in images of some frames. Frames with an up direction other than (0, -1, 0) are
 * rotated, because SOG has none.
 * @throws GaussianSplatError `argument/value` for frames with different counts of splats
 */
export async function codeSequence(options: CodeSequenceOptions): Promise<CodedSequence> {
  const { frameCount, framesPerFile, minPsnr, device, deflate, onStep = () => undefined } = options;
  const target = meanSquareOf(minPsnr);
  const { first, bytes, openOrdered } = await codeFirst(options, FIRST_SHARE * target);
  onStep(`first frame: ${bytes.length} bytes`);
  const groupAt = async (begin: number): Promise<GaussianCloud[]> => {
    const frames: GaussianCloud[] = [];
    for (let frame = begin; frame < Math.min(frameCount, begin + framesPerFile); frame++) {
      frames.push(alignAxes(await openOrdered(frame), frames.at(-1) ?? first));
    }
    return frames;
  };
  if (frameCount === 1) return { first: bytes, files: [], psnr: Infinity, worstPsnr: Infinity };
  let steps = await findMotionSteps(first, await groupAt(1), target, options);
  for (let tries = 1; ; tries++) {
    const files: Uint8Array<ArrayBuffer>[] = [];
    const errors: number[] = [];
    const every = Math.ceil((frameCount - 1) / framesPerFile / JUDGED);
    for (let begin = 1; begin < frameCount; begin += framesPerFile) {
      const frames = await groupAt(begin);
      const file = writeMotion(first, frames, { steps, deflate });
      files.push(file);
      onStep(`frames ${begin} to ${begin + frames.length - 1}: ${file.length} bytes`);
      if (files.length % every !== 0) continue;
      const frame = (5 * files.length) % frames.length;
      const judge = await judgeOf(device, frames[frame], 2, 7 + files.length);
      errors.push(...(await judge.compare(await frameOf(first, file, frames.length, frame), 'heldOut')));
      judge.destroy();
    }
    const error = errors.length > 0 ? mean(errors) : 0;
    const found = { psnr: decibels(error), worstPsnr: decibels(Math.max(0, ...errors)) };
    onStep(`${found.psnr.toFixed(2)} dB in ${errors.length} held-out views of frames`);
    if (error <= target || tries === MAX_TRIES) return { first: bytes, files, ...found };
    steps = scaledSteps(steps, 0.95 * Math.sqrt(target / error));
  }
}

/** Returns an evaluator that compares clouds with `cloud` in `count` views; `heldOut` and `searched` views are the same. */
export function judgeOf(device: GPUDevice, cloud: GaussianCloud, count: number, seed: number): Promise<GpuEvaluator> {
  const views = viewsAround(boundsOf(cloud), count, { seed });
  return GpuEvaluator.create(device, cloud, { scored: views.slice(0, 1), searched: views, heldOut: views });
}

/**
 * Encodes the first frame as SOG. Returns the bytes, the splats decoded from them, and a function that opens a frame
 * with its splats in the order of this file.
 */
async function codeFirst({ openFrame, device, encodeWebp }: CodeSequenceOptions, target: number) {
  const source = upright(await openFrame(0));
  const judge = await judgeOf(device, source, 3, 1);
  const whole = { cloud: source, degrees: new Uint8Array(source.count).fill(source.shDegree) };
  const read = (bytes: Uint8Array): Promise<GaussianCloud> => readScene(bytes, { name: 'first.sog' });
  const measure = async (bytes: Uint8Array): Promise<number> => mean(await judge.compare(await read(bytes), 'heldOut'));
  const encoding = await tuneSog(encodeWebp).tune!(whole, measure, target);
  const bytes = new Uint8Array(await encoding.write(whole));
  judge.destroy();
  const order = packedOrder(source);
  const openOrdered = async (frame: number): Promise<GaussianCloud> => {
    const cloud = upright(await openFrame(frame));
    if (cloud.count !== source.count) throw notCorresponding(frame, source.count, cloud.count);
    return splatsOf(cloud, order);
  };
  return { bytes, first: await read(bytes), openOrdered };
}

/**
 * Finds the steps of motion that reach the target in a frame of a motion file, balanced between attributes by
 * {@link findSteps}.
 */
async function findMotionSteps(
  first: GaussianCloud,
  frames: readonly GaussianCloud[],
  target: number,
  { device, deflate, deflateQuickly = deflate, onStep = () => undefined }: CodeSequenceOptions,
): Promise<MotionSteps> {
  const measured = Math.floor(0.7 * frames.length);
  const judge = await judgeOf(device, frames[measured], 2, 3);
  const measure = async (steps: MotionSteps): Promise<number> => {
    const bytes = writeMotion(first, frames, { steps, deflate: deflateQuickly });
    return mean(await judge.compare(await frameOf(first, bytes, frames.length, measured), 'heldOut'));
  };
  const { steps } = await findSteps({
    usual: { position: 0.15 * typicalSize(first), rotation: 0.1, scale: 0.1, opacity: 0.03, color: 0.05 },
    numbers: numbersOf(frames),
    ...{ measure, target, nearEnough: NEAR_ENOUGH },
    judge: async (scaled: MotionSteps) => {
      const error = await measure(scaled);
      onStep(`${decibels(error).toFixed(2)} dB in a frame of the first file`);
      return { error };
    },
  });
  judge.destroy();
  return steps;
}

/** Returns the median, over all splats, of their middle standard deviation. */
export function typicalSize({ scales, count }: GaussianCloud): number {
  const middle = (i: number): number => [...scales.subarray(3 * i, 3 * i + 3)].sort((a, b) => a - b)[1];
  return Float64Array.from({ length: count }, (_, i) => middle(i)).sort()[count >> 1];
}

const ARRAYS = {
  position: 'positions',
  rotation: 'rotations',
  scale: 'scales',
  opacity: 'opacities',
  color: 'sh',
} as const;

/** Returns the count of a splat's numbers for each attribute that changes between two of the frames. */
function numbersOf(frames: readonly GaussianCloud[]): Partial<Steps<AnimatedAttributeName>> {
  const [one, other] = [frames[0], frames[frames.length >> 1]];
  const changes = (name: AnimatedAttributeName): boolean =>
    one[ARRAYS[name]].some((value, i) => value !== other[ARRAYS[name]][i]);
  return Object.fromEntries(ANIMATED_ATTRIBUTE_NAMES.filter(changes).map((name) => [name, ANIMATED_ATTRIBUTES[name]]));
}

/** Decodes a frame of a motion file. */
async function frameOf(first: GaussianCloud, bytes: Uint8Array, frames: number, frame: number): Promise<GaussianCloud> {
  const budget = (): LoadBudget => new LoadBudget(2 ** 40);
  const motion = await readMotion({ bytes, name: 'motion', splats: first.count, frames, budget: budget() });
  return applyMotion(first, motion, frame, 'motion', budget());
}

const notCorresponding = (frame: number, expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `frame ${frame}`,
    expected: `${expected} splats in each frame, the same ones in the same order`,
    found: `${found}`,
    remedy: 'keep scene files for such frames',
  });
