import { boundsOf, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import {
  clipFrame,
  LoadBudget,
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  readScene,
  toDegree,
  upright,
  writeClipHead,
  type ClipHead,
  type ClipPartContent,
  type AnimatedAttributeName,
} from '@gaussian-splat/formats';
import { GpuEvaluator } from '../gpu/gpu-evaluator.js';
import { decibels, mean, meanSquareOf } from '../measure.js';
import type { Deflate } from '../pages/page-planes.js';
import type { MotionSteps } from './write-motion.js';
import { findSteps, scaledSteps, type Steps } from '../steps.js';
import { viewsAround } from '../views.js';
import type { Encoding } from '../write/index.js';
import type { EncodeWebp } from '../write/sog.js';
import { tuneSog } from '../write/tune-sog.js';
import { TrackedPart, type WrittenClipPart } from './clip-part.js';
import { coarseAndRest } from './coarse-part.js';
import { cutTracks } from './cut-tracks.js';
import { cloudOfTracks, followSplats, type Tracks } from './tracks.js';

export interface CodeClipOptions {
  readonly frameCount: number;
  /** Reads a frame by its index. Frames may have different splats. */
  readonly openFrame: (frame: number) => Promise<GaussianCloud>;
  readonly framesPerSecond: number;
  readonly framesPerGroup: number;
  /** Target PSNR of frames against their sources in dB, over covered pixels. */
  readonly minPsnr: number;
  readonly device: GPUDevice;
  readonly encodeWebp: EncodeWebp;
  readonly deflate: Deflate;
  /** Called with a sentence about each step. */
  readonly onStep?: (step: string) => void;
  /**
   * Maximum bit rate of each group in megabits per second; default no limit. It takes precedence over `minPsnr`, and
   * `worstPsnr` of the result shows its effect.
   */
  readonly maxMbps?: number;
  /**
   * Fixed quantization. Then images are not measured, and no GPU device is used. By default, measurements determine the
   * quantization.
   */
  readonly rounding?: { readonly encoding: Encoding; readonly steps: MotionSteps };
}

export interface CodedClip {
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** Number of bytes that must arrive before the first frame can be shown. */
  readonly firstBytes: number;
  readonly groups: number;
  /** Number of splats over all groups. */
  readonly splats: number;
  /** Number of splats that do not exist in some frames of their group. */
  readonly passing: number;
  /** PSNR of all measured frames together in dB; NaN if none was measured. */
  readonly psnr: number;
  /** PSNR of the view with the largest error in dB; NaN if none was measured. */
  readonly worstPsnr: number;
}

/** Fraction of the allowed error that the scenes of groups may cause; motion may cause the rest. */
const SCENE_SHARE = 0.4;
const MAX_TRIES = 5;
const NEAR_ENOUGH = 0.85;
/** Ratio of the current steps of motion to the finest ones, for finding curves. */
const FINER = 16;
/** Frames of a group that are measured, as fractions of its duration. */
const JUDGED = [0.2, 0.75];
const VIEWS = 2;
const GROWTHS = [1, 1.25, 1.6, 2, 2.5, 3.2, 4];

/**
 * Encodes frames with arbitrary splats as a clip. Quantization is as coarse as `minPsnr` allows, in held-out views of
 * some frames. Frames with an up direction other than (0, -1, 0) are rotated, as in all formats without one. All frames
 * of a group get the highest degree of spherical harmonics until then.
 */
export async function codeClip(options: CodeClipOptions): Promise<CodedClip> {
  const coder = new ClipCoder(options);
  const { frameCount, framesPerGroup } = options;
  for (let begin = 0; begin < frameCount; begin += framesPerGroup)
    await coder.add(begin, Math.min(frameCount, begin + framesPerGroup));
  return coder.finish();
}

/** An encoded group. `errors` has the mean squared error of each measured view. */
interface WrittenGroup {
  readonly frames: number;
  readonly parts: readonly WrittenClipPart[];
  readonly errors: readonly number[];
}

class ClipCoder {
  readonly #options: CodeClipOptions;
  readonly #target: number;
  readonly #groups: WrittenGroup[] = [];
  #facts: Omit<ClipHead, 'groups' | 'grow' | 'framesPerSecond' | 'shDegree'> | undefined;
  /** Highest degree of the frames until now. */
  #shDegree: ShDegree = 0;
  #encoding: Encoding | undefined;
  #steps: MotionSteps | undefined;
  #grow = 1;
  #largest = 0;
  #splats = 0;
  #passing = 0;

  constructor(options: CodeClipOptions) {
    this.#options = options;
    this.#target = meanSquareOf(options.minPsnr);
  }

  async add(begin: number, end: number): Promise<void> {
    const { openFrame, onStep = () => undefined } = this.#options;
    const opened: GaussianCloud[] = [];
    for (let frame = begin; frame < end; frame++) opened.push(upright(await openFrame(frame)));
    const degree = Math.max(this.#shDegree, ...opened.map(({ shDegree }) => shDegree)) as ShDegree;
    // An encoding is tuned for the harmonics that its frames have.
    if (degree > this.#shDegree) this.#encoding = undefined;
    this.#shDegree = degree;
    const sources = opened.map((cloud) => toDegree(degree, cloud));
    const tracks = cutTracks(followSplats(sources));
    const whole = cloudOfTracks(tracks);
    const passing = tracks.lives.first.filter((first, i) => first > 0 || tracks.lives.end[i] < end - begin).length;
    this.#splats += tracks.count;
    this.#passing += passing;
    this.#note(sources[0], whole);
    onStep(`frames ${begin} to ${end - 1}: ${tracks.count} splats, ${passing} of them in some frames only`);
    const chosen = coarseAndRest(whole, tracks);
    const { rounding } = this.#options;
    if (rounding) return void this.#groups.push(await this.#roundAs(rounding, tracks, whole, chosen));
    this.#encoding ??= await this.#tune(tracks.frames[Math.floor(JUDGED[0] * tracks.frames.length)]);
    const group = await this.#code(tracks, whole, chosen);
    this.#groups.push(group);
    const bytes = bytesOf(group);
    const worst = decibels(Math.max(...group.errors)).toFixed(2);
    onStep(`  ${bytes} bytes, ${group.parts[0].bytes.length} of them coarse; ${worst} dB in the worst view`);
  }

  async #roundAs(
    { encoding, steps }: NonNullable<CodeClipOptions['rounding']>,
    tracks: Tracks,
    whole: GaussianCloud,
    chosen: readonly Uint32Array[],
  ): Promise<WrittenGroup> {
    const parts: WrittenClipPart[] = [];
    for (const own of chosen)
      parts.push((await TrackedPart.of(tracks, whole, own, encoding, steps)).write(steps, this.#options.deflate));
    return { frames: tracks.frames.length, parts, errors: [] };
  }

  finish(): CodedClip {
    const { framesPerSecond } = this.#options;
    const groups = this.#groups;
    const head = writeClipHead({
      ...this.#facts!,
      ...{ shDegree: this.#shDegree, framesPerSecond, grow: this.#grow, groups },
    });
    const bytes = concatenated(Uint8Array, [head, ...groups.flatMap(({ parts }) => parts.map((part) => part.bytes))]);
    const errors = groups.flatMap((group) => group.errors);
    return {
      bytes,
      firstBytes: head.length + groups[0].parts[0].bytes.length,
      ...{ groups: groups.length, splats: this.#splats, passing: this.#passing },
      psnr: errors.length > 0 ? decibels(mean(errors)) : NaN,
      worstPsnr: errors.length > 0 ? decibels(Math.max(...errors)) : NaN,
    };
  }

  /** Sets the properties of the clip. Its bounds, which determine views, are those of the group with the most splats. */
  #note(frame: GaussianCloud, whole: GaussianCloud): void {
    if (whole.count <= this.#largest) return;
    this.#largest = whole.count;
    const { antialiased, filterVariance } = frame;
    const { origin } = this.#facts ?? frame;
    this.#facts = {
      origin,
      antialiased,
      filterVariance,
      bounds: boundsOf(whole),
    };
  }

  /** Returns an encoding of scenes whose steps are measured with a frame of the first group. */
  async #tune(cloud: GaussianCloud): Promise<Encoding> {
    const { device, encodeWebp, onStep = () => undefined } = this.#options;
    const judge = await judgeOf(device, cloud, 3, 1);
    const whole = { cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) };
    const measure = async (bytes: Uint8Array): Promise<number> =>
      Math.max(...(await judge.compare(await readScene(bytes, { name: 'a group of frames' }), 'heldOut')));
    const encoding = await tuneSog(encodeWebp).tune!(whole, measure, SCENE_SHARE * this.#target);
    judge.destroy();
    onStep(`scenes of groups: ${encoding.title}`);
    return encoding;
  }

  async #code(tracks: Tracks, whole: GaussianCloud, chosen: readonly Uint32Array[]): Promise<WrittenGroup> {
    const { device, deflate, maxMbps = Infinity, framesPerSecond } = this.#options;
    const frames = tracks.frames.length;
    const max = (maxMbps * 1e6 * frames) / (8 * framesPerSecond);
    const judges = await judgesOf(device, tracks.frames);
    let encoding = this.#encoding!;
    let finest = this.#steps ?? usualSteps(whole);
    let steps = this.#steps;
    try {
      for (let tries = 1; ; tries++) {
        const parts: TrackedPart[] = [];
        for (const own of chosen)
          parts.push(await TrackedPart.of(tracks, whole, own, encoding, scaledSteps(finest, 1 / FINER)));
        steps ??= await this.#findSteps(parts, tracks, judges);
        const contents = parts.map((part) => part.contentAt(steps!));
        const errors = await errorsIn(judges, contents);
        if (this.#groups.length === 0) this.#grow = await growthIn(judges[0], contents);
        const worst = Math.max(...errors);
        const group = { frames, errors, parts: parts.map((part) => part.write(steps!, deflate)) };
        const isTooLarge = bytesOf(group) > max;
        this.#steps = steps;
        if ((!isTooLarge && worst <= this.#target) || (!isTooLarge && max < Infinity) || tries === MAX_TRIES)
          return group;
        const factor = isTooLarge
          ? Math.min(3, (bytesOf(group) / max) ** 1.5)
          : Math.max(0.5, 0.93 * Math.sqrt(this.#target / worst));
        steps = scaledSteps(steps, factor);
        finest = steps;
        encoding = encoding.coarser!(factor);
      }
    } finally {
      for (const { judge } of judges) judge.destroy();
    }
  }

  /**
   * Finds the steps of motion that reach the target in a frame of the first group, balanced between attributes by
   * {@link findSteps}.
   */
  async #findSteps(
    parts: readonly TrackedPart[],
    { frames }: Tracks,
    judges: readonly FrameJudge[],
  ): Promise<MotionSteps> {
    const { onStep = () => undefined } = this.#options;
    const last = judges.slice(-1);
    const measure = async (steps: MotionSteps): Promise<number> =>
      Math.max(
        ...(await errorsIn(
          last,
          parts.map((part) => part.contentAt(steps)),
        )),
      );
    const still = parts.map((part) => part.contentAt(usualSteps(frames[0])));
    const numbers = Object.fromEntries(
      ANIMATED_ATTRIBUTE_NAMES.filter((name) => still.some(({ motion }) => motion.parts[name].rank > 0)).map((name) => [
        name,
        ANIMATED_ATTRIBUTES[name],
      ]),
    ) as Partial<Steps<AnimatedAttributeName>>;
    if (Object.keys(numbers).length === 0) return usualSteps(frames[0]);
    const { steps } = await findSteps({
      ...{ usual: usualSteps(frames[0]), numbers, measure, target: this.#target, nearEnough: NEAR_ENOUGH },
      share: (1 - SCENE_SHARE) * this.#target,
      judge: async (tried: MotionSteps) => {
        const error = await measure(tried);
        onStep(`  ${decibels(error).toFixed(2)} dB in a frame of the first group`);
        return { error };
      },
    });
    return steps;
  }
}

const usualSteps = (cloud: GaussianCloud): MotionSteps => ({
  position: 0.15 * typicalSize(cloud),
  rotation: 0.1,
  scale: 0.1,
  opacity: 0.03,
  color: 0.05,
});

const bytesOf = ({ parts }: Pick<WrittenGroup, 'parts'>): number =>
  parts.reduce((sum, part) => sum + part.bytes.length, 0);

/** Index of a frame in a group, and an evaluator that compares clouds with this frame. */
interface FrameJudge {
  readonly frame: number;
  readonly judge: GpuEvaluator;
}

async function judgesOf(device: GPUDevice, frames: readonly GaussianCloud[]): Promise<FrameJudge[]> {
  const numbers = [...new Set(JUDGED.map((share) => Math.floor(share * frames.length)))];
  const judges: FrameJudge[] = [];
  for (const frame of numbers) judges.push({ frame, judge: await judgeOf(device, frames[frame], VIEWS, 7 + frame) });
  return judges;
}

const frameOf = (parts: readonly ClipPartContent[], frame: number): GaussianCloud =>
  clipFrame(parts, frame, 'a group of frames', new LoadBudget(2 ** 40));

async function errorsIn(judges: readonly FrameJudge[], parts: readonly ClipPartContent[]): Promise<number[]> {
  const errors: number[] = [];
  for (const { judge, frame } of judges) errors.push(...(await judge.compare(frameOf(parts, frame), 'heldOut')));
  return errors;
}

/** Returns the factor of the scales of the coarse part's splats with the smallest error against all splats. */
async function growthIn({ judge, frame }: FrameJudge, [coarse]: readonly ClipPartContent[]): Promise<number> {
  const cloud = frameOf([coarse], frame);
  let [best, min] = [1, Infinity];
  for (const grow of GROWTHS) {
    const error = mean(await judge.compare({ ...cloud, scales: cloud.scales.map((value) => grow * value) }, 'heldOut'));
    if (error < min) [best, min] = [grow, error];
  }
  return best;
}

/** Returns an evaluator that compares clouds with `cloud` in `count` views; `heldOut` and `searched` views are the same. */
function judgeOf(device: GPUDevice, cloud: GaussianCloud, count: number, seed: number): Promise<GpuEvaluator> {
  const views = viewsAround(boundsOf(cloud), count, { seed });
  return GpuEvaluator.create(device, cloud, { scored: views.slice(0, 1), searched: views, heldOut: views });
}

/** Returns the median, over all splats, of their middle standard deviation. */
function typicalSize({ scales, count }: GaussianCloud): number {
  const middle = (i: number): number => [...scales.subarray(3 * i, 3 * i + 3)].sort((a, b) => a - b)[1];
  return Float64Array.from({ length: count }, (_, i) => middle(i)).sort()[count >> 1];
}
