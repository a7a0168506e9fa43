import { boundsOf, toDegree, type Credits, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { joinCredits, readScene, upright, writeClipHead } from '@gaussian-splat/formats';
import { decibels, mean, meanSquareOf } from '../measure.js';
import type { Encoding } from '../write/index.js';
import type { EncodeWebp } from '../write/sog.js';
import { sogOf, tuneSog } from '../write/tune-sog.js';
import { writeState, readState, type ClipState, type ClipStore } from './clip-store.js';
import { coarseAndRest } from './coarse-part.js';
import type { MotionSteps } from './curves.js';
import { cutTracks } from './cut-tracks.js';
import { FrameJudges, type DrawFrame } from './frame-judges.js';
import { codeGroup, growthIn, roundGroup, SCENE_SHARE, sizeOf, worstOf, type CodedGroup } from './group-coder.js';
import { StillSplats } from './still-splats.js';
import { readStillPart, writeStillPart, type StillPart } from './still-part.js';
import { cloudOfTracks, followSplats, type Tracks } from './tracks.js';

export interface CodeClipOptions {
  readonly frameCount: number;
  /** Reads a frame by its index. Frames may have different splats. */
  readonly openFrame: (frame: number) => Promise<GaussianCloud>;
  readonly framesPerSecond: number;
  /** Credits of the clip, in place of those of its frames. */
  readonly credits?: Credits | undefined;
  /**
   * Maximum number of frames of a group. Default: 100, and up to 300 if few splats move, so that a group has about as many
   * bytes.
   */
  readonly framesPerGroup?: number | undefined;
  /** Target PSNR of each frame against its source in dB, over covered pixels of its views together. */
  readonly minPsnr: number;
  /** Draws the frames that are measured, for example {@link drawOn} a device. Unused with `rounding`. */
  readonly draw: DrawFrame;
  readonly encodeWebp: EncodeWebp;
  /** Called with a sentence about each step. */
  readonly onStep?: (step: string) => void;
  /** Called with the number of coded frames after each group. */
  readonly onProgress?: (frames: number) => void;
  /** Codes all groups after the first one, several at a time, by {@link codeClipRange}. The result is the same. */
  readonly jobs?: ClipJobs | undefined;
  /** Memory of finished groups, so that an interrupted call continues after its last group. Default: none. */
  readonly store?: ClipStore;
  /**
   * Maximum bit rate of each group in megabits per second; default no limit. It takes precedence over `minPsnr`, and
   * `worstPsnr` of the result shows its effect.
   */
  readonly maxMbps?: number;
  /**
   * Fixed quantization. Then images are not measured. By default, measurements determine the
   * quantization.
   */
  readonly rounding?: { readonly encoding: Encoding; readonly steps: MotionSteps };
}

/** Processes or threads that call {@link codeClipRange}. */
export interface ClipJobs {
  /** Maximum number of calls at a time. */
  readonly count: number;
  /** Returns the state of {@link codeClipRange}, called with the options of the clip. Arguments can be cloned. */
  readonly code: (range: ClipRange) => Promise<ClipState>;
}

/** Consecutive frames of a clip that are coded apart from others. */
export interface ClipRange {
  /** Index of the first frame, and of the frame after the last one. */
  readonly begin: number;
  readonly end: number;
  /** State after the first group, without groups. */
  readonly state: ClipState;
  readonly still: GaussianCloud | undefined;
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
  /** Number of splats that never change, which the clip has once. */
  readonly still: number;
  /** Number of measured frames. */
  readonly measured: number;
  /** PSNR of the frame with the largest error, in its views together, in dB; NaN if none was measured. */
  readonly worstPsnr: number;
  /** PSNR of the view with the largest error in dB; NaN if none was measured. */
  readonly worstViewPsnr: number;
}

/** Maximum bytes of the frames of a group in memory. Groups of large frames are shorter. */
const MAX_GROUP_BYTES = 896 << 20;
const MIN_GROUP_FRAMES = 2;
/** Default number of frames of a group, and its maximum, which a group reaches if few splats move. */
const [USUAL_FRAMES, MAX_USUAL_FRAMES] = [100, 300];
/** Product of the default number of frames and the number of splats that move, for numbers between these two. */
const USUAL_WORK = 5_000_000;
/** Frame of the first group, as a fraction of its duration, that selects the encoding of scenes. */
const TUNED = 0.2;

/**
 * Encodes frames with arbitrary splats as a clip. Quantization is as coarse as `minPsnr` allows in the worst frame, in
 * its held-out views together. Frames with an up direction other than (0, -1, 0) are rotated, as in all formats without one. All
 * frames of a group get the highest degree of spherical harmonics until then. Splats that never change are stored once.
 */
export async function codeClip(options: CodeClipOptions): Promise<CodedClip> {
  const { frameCount, jobs } = options;
  const coder = new ClipCoder(options);
  await coder.begin();
  while (coder.next < frameCount) await (jobs && jobs.count > 1 && coder.next > 0 ? coder.addBy(jobs) : coder.add());
  return coder.finish();
}

/**
 * Codes some frames of a clip, for {@link ClipJobs}.
 * @param options Those of the clip. `store` and `jobs` are not used.
 */
export async function codeClipRange(options: CodeClipOptions, range: ClipRange): Promise<ClipState> {
  const coder = new ClipCoder({ ...options, frameCount: range.end, store: undefined }, range);
  await coder.restore(range.state);
  while (coder.next < range.end) await coder.add();
  return coder.state;
}

class ClipCoder {
  readonly #options: CodeClipOptions;
  readonly #target: number;
  readonly #onStep: (step: string) => void;
  /** Index of the first frame to code. */
  readonly #first: number;
  #still: StillSplats | undefined;
  #stillParts: readonly StillPart[] = [];
  #groups: CodedGroup[] = [];
  #facts: ClipState['facts'];
  /** Highest degree of the frames until now. */
  #shDegree: ShDegree = 0;
  /** Quantization of the first group, with which the search of others begins. */
  #encoding: Encoding | undefined;
  #steps: MotionSteps | undefined;
  #framesPerGroup: number | undefined;
  #grow = 1;
  #largest = 0;
  #splats = 0;
  #passing = 0;

  constructor(options: CodeClipOptions, { begin = 0, still }: Partial<ClipRange> = {}) {
    this.#options = options;
    this.#target = meanSquareOf(options.minPsnr);
    this.#onStep = options.onStep ?? (() => undefined);
    this.#framesPerGroup = options.framesPerGroup;
    this.#first = begin;
    this.#still = still && new StillSplats(still, options.minPsnr);
  }

  /** Index of the first frame that is not coded. */
  get next(): number {
    return this.#groups.reduce((sum, { frames }) => sum + frames, this.#first);
  }

  get state(): ClipState {
    return {
      ...{ encoding: this.#encoding?.sog, steps: this.#steps, facts: this.#facts, shDegree: this.#shDegree },
      ...{ framesPerGroup: this.#framesPerGroup, grow: this.#grow, largest: this.#largest },
      ...{ splats: this.#splats, passing: this.#passing },
      ...{ groups: this.#groups, still: this.#stillParts.map(({ written }) => written) },
    };
  }

  /** Finds the splats that never change, and continues an interrupted call. */
  async begin(): Promise<void> {
    const { frameCount, framesPerGroup = USUAL_FRAMES, minPsnr, store } = this.#options;
    // One group has each of its splats once in any case.
    if (frameCount > framesPerGroup)
      this.#still = await StillSplats.find((frame) => this.#open(frame), frameCount, minPsnr);
    if (this.#still) this.#onStep(`${this.#still.cloud.count} splats never change`);
    const state = store && (await readState(store));
    if (!state) return;
    await this.restore(state);
    this.#onStep(`continues with frame ${this.next}`);
  }

  async restore(state: ClipState): Promise<void> {
    const { encoding, steps, facts, shDegree, framesPerGroup, grow, largest, splats, passing, groups, still } = state;
    this.#encoding = encoding && sogOf(encoding, this.#options.encodeWebp);
    [this.#steps, this.#facts, this.#shDegree, this.#grow] = [steps, facts, shDegree, grow];
    [this.#largest, this.#splats, this.#passing] = [largest, splats, passing];
    this.#framesPerGroup = framesPerGroup;
    this.#groups = [...groups];
    this.#stillParts = await Promise.all(still.map(readStillPart));
  }

  /** Codes all other groups by jobs, and takes them in order. */
  async addBy({ count, code }: ClipJobs): Promise<void> {
    const { frameCount } = this.#options;
    const length = this.#groups[0].frames;
    const state = { ...this.state, groups: [], splats: 0, passing: 0 };
    const begins: number[] = [];
    for (let begin = this.next; begin < frameCount; begin += length) begins.push(begin);
    const started: Promise<ClipState>[] = [];
    const start = (k: number): void => {
      if (k >= begins.length) return;
      const [begin, end] = [begins[k], Math.min(frameCount, begins[k] + length)];
      started[k] = code({ begin, end, state, still: this.#still?.cloud });
      // A failure is that of the first range that fails, below.
      started[k].then(
        () => start(started.length),
        () => undefined,
      );
    };
    for (let k = 0; k < Math.min(count, begins.length); k++) start(k);
    for (let k = 0; k < begins.length; k++) await this.#take(await started[k]);
  }

  /** Adds the groups of a range. */
  async #take({ facts, shDegree, largest, splats, passing, groups }: ClipState): Promise<void> {
    const credits = joinCredits([this.#facts?.credits, facts?.credits]);
    this.#facts = { ...(largest > this.#largest ? facts! : this.#facts!), credits };
    this.#largest = Math.max(this.#largest, largest);
    this.#shDegree = Math.max(this.#shDegree, shDegree) as ShDegree;
    this.#splats += splats;
    this.#passing += passing;
    this.#groups.push(...groups);
    await this.#save(groups.length);
    this.#options.onProgress?.(this.next);
  }

  /** Codes the next group. */
  async add(): Promise<void> {
    const { rounding, maxMbps = Infinity, framesPerSecond, onProgress } = this.#options;
    const begin = this.next;
    const sources = await this.#openGroup(begin);
    const tracks = cutTracks(followSplats(sources));
    const whole = cloudOfTracks(tracks);
    const frames = sources.length;
    const passing = tracks.lives.first.filter((first, i) => first > 0 || tracks.lives.end[i] < frames).length;
    this.#splats += tracks.count;
    this.#passing += passing;
    this.#note(sources, whole);
    this.#onStep(
      `frames ${begin} to ${begin + frames - 1}: ${tracks.count} splats, ${passing} of them in some frames only`,
    );
    const chosen = coarseAndRest(whole, tracks);
    if (rounding) {
      await this.#writeStill(rounding.encoding);
      this.#groups.push(await roundGroup({ tracks, whole, chosen }, rounding.encoding, rounding.steps));
    } else {
      this.#encoding ??= await this.#tune(await this.#shown(begin + Math.floor(TUNED * frames)));
      await this.#writeStill(this.#encoding);
      const maxBytes = (maxMbps * 1e6 * frames) / (8 * framesPerSecond);
      await this.#code(tracks, whole, chosen, begin, maxBytes);
    }
    await this.#save();
    onProgress?.(this.next);
  }

  finish(): CodedClip {
    const { framesPerSecond, credits } = this.#options;
    const groups = this.#groups;
    const still = this.#stillParts.map(({ written }) => written);
    const head = writeClipHead({
      ...{ ...this.#facts!, framesPerSecond, shDegree: this.#shDegree, grow: this.#grow },
      credits: { ...this.#facts!.credits, ...credits },
      ...{ groups, still },
    });
    const errors = groups.flatMap((group) => group.errors);
    const parts = [...still, ...groups.flatMap((group) => group.parts)];
    const ofFirst = (still[0]?.bytes.length ?? 0) + groups[0].parts[0].bytes.length;
    return {
      bytes: concatenated(Uint8Array, [head, ...parts.map(({ bytes }) => bytes)]),
      firstBytes: head.length + ofFirst,
      ...{ groups: groups.length, splats: this.#splats, passing: this.#passing },
      still: still.reduce((sum, { splats }) => sum + splats, 0),
      measured: errors.length,
      psnr: errors.length > 0 ? decibels(mean(errors.map(({ error }) => error))) : NaN,
      worstPsnr: errors.length > 0 ? decibels(worstOf(errors)) : NaN,
      worstViewPsnr: errors.length > 0 ? decibels(Math.max(...errors.map(({ worst }) => worst))) : NaN,
    };
  }

  async #open(frame: number): Promise<GaussianCloud> {
    return upright(await this.#options.openFrame(frame));
  }

  /** Returns a frame as the clip should show it. */
  async #shown(frame: number): Promise<GaussianCloud> {
    return toDegree(this.#shDegree, await this.#open(frame));
  }

  /** Reads the frames of a group, without splats that never change, of one degree. */
  async #openGroup(begin: number): Promise<readonly GaussianCloud[]> {
    const { frameCount } = this.#options;
    const opened: GaussianCloud[] = [];
    let bytes = 0;
    for (let frame = begin; frame < Math.min(frameCount, begin + (this.#framesPerGroup ?? 1)); frame++) {
      const cloud = await this.#open(frame);
      opened.push(this.#still ? this.#still.without(cloud) : cloud);
      this.#framesPerGroup ??= usualFrames(opened[0].count);
      const { positions, scales, rotations, opacities, sh } = opened[opened.length - 1];
      for (const own of [positions, scales, rotations, opacities, sh]) bytes += own.byteLength;
      if (bytes > MAX_GROUP_BYTES && opened.length >= MIN_GROUP_FRAMES) break;
    }
    const degree = Math.max(this.#shDegree, ...opened.map(({ shDegree }) => shDegree)) as ShDegree;
    // An encoding is tuned for the harmonics that its frames have.
    if (degree > this.#shDegree) this.#encoding = undefined;
    this.#shDegree = degree;
    return opened.map((cloud) => toDegree(degree, cloud));
  }

  async #code(
    tracks: Tracks,
    whole: GaussianCloud,
    chosen: readonly Uint32Array[],
    begin: number,
    maxBytes: number,
  ): Promise<void> {
    const judges = new FrameJudges(this.#options.draw, (frame) => this.#shown(begin + frame));
    const still = this.#stillParts.map(({ content }) => content);
    try {
      const { contents, encoding, steps, frames, parts, errors } = await codeGroup({
        ...{ tracks, whole, chosen, still, judges, maxBytes, target: this.#target, seed: begin },
        ...{ encoding: this.#encoding!, steps: this.#steps, onStep: this.#onStep },
      });
      if (begin === 0) {
        this.#grow = await growthIn(judges, [...still.slice(0, 1), contents[0]]);
        [this.#encoding, this.#steps] = [encoding, steps];
      }
      const group = { frames, parts, errors };
      this.#groups.push(group);
      const { frame, error } = group.errors.reduce((worst, own) => (own.error > worst.error ? own : worst));
      this.#onStep(
        `  ${sizeOf(group.parts)} bytes, ${group.parts[0].bytes.length} of them coarse; ` +
          `${decibels(error).toFixed(2)} dB in the worst frame, ${begin + frame}`,
      );
    } finally {
      judges.destroy();
    }
  }

  async #writeStill(encoding: Encoding): Promise<void> {
    if (!this.#still || this.#stillParts.length > 0) return;
    const { cloud } = this.#still;
    const parts: StillPart[] = [];
    for (const own of coarseAndRest(cloud)) parts.push(await writeStillPart(cloud, own, encoding));
    this.#stillParts = parts;
  }

  /** @param added Number of groups that were added after the last call. */
  async #save(added = 1): Promise<void> {
    const { store } = this.#options;
    if (store) await writeState(store, this.state, added);
  }

  /** Sets the properties of the clip. Its bounds, which determine views, are those of the group with the most splats. */
  #note(frames: readonly GaussianCloud[], whole: GaussianCloud): void {
    const credits = joinCredits([this.#facts?.credits, ...frames.map(({ hints }) => hints?.credits)]);
    if (this.#facts) this.#facts = { ...this.#facts, credits };
    if (whole.count <= this.#largest) return;
    this.#largest = whole.count;
    const { antialiased, filterVariance } = frames[0];
    const { origin } = this.#facts ?? frames[0];
    const bounds = boundsOf(together(whole, this.#still?.cloud));
    this.#facts = { origin, antialiased, filterVariance, bounds, credits };
  }

  /** Returns an encoding of scenes whose steps are measured with a frame of the first group. */
  async #tune(cloud: GaussianCloud): Promise<Encoding> {
    const { draw, encodeWebp } = this.#options;
    const judges = new FrameJudges(draw, () => Promise.resolve(cloud));
    const whole = { cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) };
    const measure = async (bytes: Uint8Array): Promise<number> =>
      mean(await judges.compare(0, await readScene(bytes, { name: 'a group of frames' })));
    try {
      const encoding = await tuneSog(encodeWebp).tune!(whole, measure, SCENE_SHARE * this.#target);
      this.#onStep(`scenes of groups: ${encoding.title}`);
      return encoding;
    } finally {
      judges.destroy();
    }
  }
}

/** Returns the default number of frames of a group with some splats that move. */
const usualFrames = (splats: number): number =>
  Math.max(USUAL_FRAMES, Math.min(MAX_USUAL_FRAMES, Math.floor(USUAL_WORK / splats)));

/** Returns what the bounds of two clouds depend on. */
function together(a: GaussianCloud, b: GaussianCloud | undefined): Parameters<typeof boundsOf>[0] {
  if (!b) return a;
  const shift = b.origin.map((value, axis) => value - a.origin[axis]);
  return {
    ...{ count: a.count + b.count, origin: a.origin },
    positions: concatenated(Float32Array, [a.positions, b.positions.map((value, k) => value + shift[k % 3])]),
    opacities: concatenated(Float32Array, [a.opacities, b.opacities]),
  };
}
