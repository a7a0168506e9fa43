import { boundsOf, type Credits, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { joinCredits, readScene, toDegree, upright, writeClipHead } from '@gaussian-splat/formats';
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
  readonly framesPerGroup: number;
  /** Target PSNR of each frame against its source in dB, over covered pixels of its views together. */
  readonly minPsnr: number;
  /** Draws the frames that are measured, for example {@link drawOn} a device. Unused with `rounding`. */
  readonly draw: DrawFrame;
  readonly encodeWebp: EncodeWebp;
  /** Called with a sentence about each step. */
  readonly onStep?: (step: string) => void;
  /** Called with the number of coded frames after each group. */
  readonly onProgress?: (frames: number) => void;
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
const MAX_GROUP_BYTES = 640 << 20;
const MIN_GROUP_FRAMES = 2;
/** Frame of the first group, as a fraction of its duration, that selects the encoding of scenes. */
const TUNED = 0.2;

/**
 * Encodes frames with arbitrary splats as a clip. Quantization is as coarse as `minPsnr` allows in the worst frame, in
 * its held-out views together. Frames with an up direction other than (0, -1, 0) are rotated, as in all formats without one. All
 * frames of a group get the highest degree of spherical harmonics until then. Splats that never change are stored once.
 */
export async function codeClip(options: CodeClipOptions): Promise<CodedClip> {
  const coder = new ClipCoder(options);
  await coder.begin();
  while (coder.next < options.frameCount) await coder.add();
  return coder.finish();
}

class ClipCoder {
  readonly #options: CodeClipOptions;
  readonly #target: number;
  readonly #onStep: (step: string) => void;
  #still: StillSplats | undefined;
  #stillParts: readonly StillPart[] = [];
  #groups: CodedGroup[] = [];
  #facts: ClipState['facts'];
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
    this.#onStep = options.onStep ?? (() => undefined);
  }

  /** Index of the first frame that is not coded. */
  get next(): number {
    return this.#groups.reduce((sum, { frames }) => sum + frames, 0);
  }

  /** Finds the splats that never change, and continues an interrupted call. */
  async begin(): Promise<void> {
    const { frameCount, framesPerGroup, minPsnr, store } = this.#options;
    // One group has each of its splats once in any case.
    if (frameCount > framesPerGroup)
      this.#still = await StillSplats.find((frame) => this.#open(frame), frameCount, minPsnr);
    if (this.#still) this.#onStep(`${this.#still.cloud.count} splats never change`);
    const state = store && (await readState(store));
    if (!state) return;
    const { encoding, steps, facts, shDegree, grow, largest, splats, passing, groups, still } = state;
    this.#encoding = encoding && sogOf(encoding, this.#options.encodeWebp);
    [this.#steps, this.#facts, this.#shDegree, this.#grow] = [steps, facts, shDegree, grow];
    [this.#largest, this.#splats, this.#passing] = [largest, splats, passing];
    this.#groups = [...groups];
    this.#stillParts = await Promise.all(still.map(readStillPart));
    this.#onStep(`continues with frame ${this.next}`);
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
    const { frameCount, framesPerGroup } = this.#options;
    const opened: GaussianCloud[] = [];
    let bytes = 0;
    for (let frame = begin; frame < Math.min(frameCount, begin + framesPerGroup); frame++) {
      const cloud = await this.#open(frame);
      opened.push(this.#still ? this.#still.without(cloud) : cloud);
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
        ...{ tracks, whole, chosen, still, judges, maxBytes, target: this.#target, seed: this.#groups.length },
        ...{ encoding: this.#encoding!, steps: this.#steps, onStep: this.#onStep },
      });
      if (this.#groups.length === 0) this.#grow = await growthIn(judges, [...still.slice(0, 1), contents[0]]);
      const group = { frames, parts, errors };
      this.#groups.push(group);
      [this.#encoding, this.#steps] = [encoding, steps];
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

  async #save(): Promise<void> {
    const { store } = this.#options;
    if (!store) return;
    await writeState(store, {
      ...{ encoding: this.#encoding?.sog, steps: this.#steps, facts: this.#facts, shDegree: this.#shDegree },
      ...{ grow: this.#grow, largest: this.#largest, splats: this.#splats, passing: this.#passing },
      ...{ groups: this.#groups, still: this.#stillParts.map(({ written }) => written) },
    });
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
