/** A sequence whose splats correspond as a scene and what moves in it: how coarse that may be is measured in images of some frames. */
import { boundsOf, GaussianSplatError } from '@gaussian-splat/core';
import {
  allocateSteps,
  encodingsFor,
  fitSteps,
  GpuEvaluator,
  scaledSteps,
  splatsOf,
  viewsAround,
  withNearAxes,
  writeMotion,
} from '@gaussian-splat/economise';
import { LoadBudget, movedCloud, MOVING, readMotion, readScene } from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer';
import { deflate, deflateQuickly, encodeWebp } from './encoders.mjs';

/** Of what may be lost the first frame loses so much; motion adds the rest. */
const FIRST_SHARE = 0.5;
const MOST_TRIES = 4;
const NEAR_ENOUGH = 0.85;
/** Frames that are measured at the end. */
const JUDGED = 3;
const meanOf = (errors) => errors.reduce((sum, error) => sum + error, 0) / errors.length;

/** Errors of other clouds in place of one frame, mean squared, in images of it. */
class FrameJudge {
  static async create(device, cloud, count, seed) {
    const views = viewsAround(boundsOf(cloud), count, { seed });
    const judge = new FrameJudge();
    judge.evaluator = await GpuEvaluator.create(device, cloud, {
      scored: views.slice(0, 1),
      searched: views,
      heldOut: views,
    });
    return judge;
  }

  errors = (cloud) => this.evaluator.compare(cloud, 'heldOut');

  destroy() {
    this.evaluator.destroy();
  }
}

/** Middle standard deviation of a splat that half of them are below. */
function typicalSize({ scales, count }) {
  const sizes = Float64Array.from(
    { length: count },
    (_, i) => [...scales.subarray(3 * i, 3 * i + 3)].sort((a, b) => a - b)[1],
  );
  return sizes.sort()[count >> 1];
}

const budget = () => new LoadBudget(2 ** 40);

/** A frame of a file of motion that was just written. */
async function frameOf(first, bytes, frames, frame) {
  const motion = await readMotion({ bytes, name: 'motion', splats: first.count, frames, budget: budget() });
  return movedCloud(first, motion, frame, 'motion', budget());
}

/** The first frame as SOG, and its splats as they are read from it. */
async function codeFirst(source, device, target) {
  const judge = await FrameJudge.create(device, source, 3, 1);
  const whole = { cloud: source, degrees: new Uint8Array(source.count).fill(source.shDegree) };
  const measure = async (bytes) => meanOf(await judge.errors(await readScene(bytes, { name: 'first.sog' })));
  const encoding = await encodingsFor('first.sog', source, { encodeWebp })[0].tune(whole, measure, target);
  const bytes = await encoding.write(whole);
  judge.destroy();
  return { bytes, cloud: await readScene(bytes, { name: 'first.sog' }) };
}

const ARRAYS = { position: 'positions', rotation: 'rotations', scale: 'scales', opacity: 'opacities', color: 'sh' };

/** Numbers of a splat of each attribute that changes. */
function numbersOf(frames) {
  const [one, other] = [frames[0], frames[frames.length >> 1]];
  const changes = (name) => one[ARRAYS[name]].some((value, i) => value !== other[ARRAYS[name]][i]);
  return Object.fromEntries(Object.entries(MOVING).filter(([name]) => changes(name)));
}

/** Steps at which a frame of a file of motion loses so much, and a byte saves the same in all attributes. */
async function findSteps({ first, frames, device, target, onStep }) {
  const measured = Math.floor(0.7 * frames.length);
  const judge = await FrameJudge.create(device, frames[measured], 2, 3);
  const measure = async (steps) => {
    const bytes = writeMotion(first, frames, { steps, deflate: deflateQuickly });
    return meanOf(await judge.errors(await frameOf(first, bytes, frames.length, measured)));
  };
  const usual = { position: 0.15 * typicalSize(first), rotation: 0.1, scale: 0.1, opacity: 0.03, color: 0.05 };
  const { steps } = await fitSteps({
    steps: await allocateSteps({ usual, numbers: numbersOf(frames), measure, target }),
    target,
    nearEnough: NEAR_ENOUGH,
    measure: async (scaled) => {
      const error = await measure(scaled);
      onStep(`${(-10 * Math.log10(error)).toFixed(2)} dB in a frame of the first file`);
      return { error };
    },
  });
  judge.destroy();
  return steps;
}

/**
 * @param frameCount {number}
 * @param openFrame {(frame: number) => Promise<import('@gaussian-splat/core').GaussianCloud>} all of the same splats in the same order
 * @param framesPerFile {number}
 * @param minDecibels {number} PSNR of frames to what they were made of
 * @param onStep {(step: string) => void} hears what was found
 * @returns the bytes of the first frame, as SOG, and of the files of motion; dB over covered pixels of the frames that were measured together, and of the worst view of them
 */
export async function codeSequence({ frameCount, openFrame, framesPerFile, minDecibels, device, onStep }) {
  const target = 10 ** (-minDecibels / 10);
  const source = await openFrame(0);
  const order = packedOrder(source);
  // As the file of the first has them: neighbours are next to one another there, and move alike.
  const openOrdered = async (frame) => {
    const cloud = await openFrame(frame);
    if (cloud.count === source.count) return splatsOf(cloud, order);
    throw new GaussianSplatError('argument/value', {
      where: `frame ${frame}`,
      expected: `${source.count} splats in each frame, the same ones in the same order`,
      found: `${cloud.count}`,
      remedy: 'keep scene files for such frames',
    });
  };
  const { bytes: firstBytes, cloud: first } = await codeFirst(source, device, FIRST_SHARE * target);
  onStep(`first frame: ${firstBytes.length} bytes`);
  const groupAt = async (begin) => {
    const frames = [];
    for (let frame = begin; frame < Math.min(frameCount, begin + framesPerFile); frame++) {
      frames.push(withNearAxes(await openOrdered(frame), frames.at(-1) ?? first));
    }
    return frames;
  };
  let steps = frameCount > 1 ? await findSteps({ first, frames: await groupAt(1), device, target, onStep }) : undefined;
  for (let tries = 1; ; tries++) {
    const [files, errors] = [[], []];
    for (let begin = 1; begin < frameCount; begin += framesPerFile) {
      const frames = await groupAt(begin);
      const bytes = writeMotion(first, frames, { steps, deflate });
      files.push(bytes);
      onStep(`frames ${begin} to ${begin + frames.length - 1}: ${bytes.length} bytes`);
      const every = Math.ceil((frameCount - 1) / framesPerFile / JUDGED);
      if (files.length % every !== 0) continue;
      const frame = (5 * files.length) % frames.length;
      const judge = await FrameJudge.create(device, frames[frame], 2, 7 + files.length);
      errors.push(...(await judge.errors(await frameOf(first, bytes, frames.length, frame))));
      judge.destroy();
    }
    const error = errors.length > 0 ? meanOf(errors) : 0;
    const found = { decibels: -10 * Math.log10(error), worstDecibels: -10 * Math.log10(Math.max(0, ...errors)) };
    onStep(`${found.decibels.toFixed(2)} dB in ${errors.length} held-out views of frames`);
    if (error <= target || tries === MOST_TRIES) return { first: firstBytes, files, ...found };
    steps = scaledSteps(steps, 0.95 * Math.sqrt(target / error));
  }
}
