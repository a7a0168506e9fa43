/** Conversion of `.4dgs` files to clips: https://github.com/avala-ai/4dgs. */
import { boundsOf, shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from '../budget.js';
import type { ClipGroup, ClipIndex } from '../clip.js';
import { clipPartBytes, type ClipPartContent } from '../clip/clip-parts.js';
import { damaged } from '../faults.js';
import { noSplats } from '../scene-errors.js';
import { ANIMATED_ATTRIBUTES, ANIMATED_ATTRIBUTE_NAMES } from '../motion.js';
import { FourDgs, type Population } from './four-dgs.js';
import { sampledMotion, type Moments } from './sampled-motion.js';
import { presence, type ChangingSplats } from './splats.js';

/**
 * Frame rates in frames per second: the default, and the minimum and maximum of a rate that follows from the states or
 * windows of a file.
 */
const [USUAL_RATE, MIN_RATE, MAX_RATE] = [30, 24, 120];
/** Maximum numbers of frames of a group; smaller ones are tried while a group exceeds {@link MAX_GROUP_BYTES} of the GPU. */
const GROUP_FRAMES = [15, 8, 4, 2, 1];
const MAX_GROUP_BYTES = 64 << 20;
/** Bytes charged for each frame, whose group may contain only this frame. The search for its chunks is charged, too. */
const FRAME_BYTES = 4096;
/** Bytes charged for each chunk and frame of a file without deltas, whose chunks are searched for each group. */
const SEARCH_BYTES = 16;
/** Bytes of the changes of a splat in a frame, while a group is converted, besides those of a cloud. */
const MOMENT_BYTES = 96;
const ALL_PLANES = ANIMATED_ATTRIBUTE_NAMES.reduce((sum, name) => sum + ANIMATED_ATTRIBUTES[name], 0);

/** A `.4dgs` file with the interface of a clip. Its groups are decoded on demand. */
export class FourDgsClip {
  readonly index: ClipIndex;
  readonly #file: FourDgs;

  private constructor(file: FourDgs, index: ClipIndex) {
    this.#file = file;
    this.index = index;
  }

  /**
   * Reads the heads of a file's records, and the splats of its first frame.
   * @param bytes The whole file.
   * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`, `decode/unsupported`, `decode/empty`, `out-of-memory/budget`
   */
  static async open(bytes: Uint8Array, name: string, limits?: LoadLimits): Promise<FourDgsClip> {
    const file = new FourDgs(bytes, name, limits);
    const { header } = file.scene;
    if (header.splats === 0) throw noSplats(name, { droppedCount: 0 });
    if (file.chunks.length === 0) throw damaged(name, 'splats', 'none', 'decode/header');
    const framesPerSecond = rateOf(file);
    const frameCount = Math.max(1, Math.ceil(playedSeconds(file) * framesPerSecond - 1e-6));
    const searched = file.isKeyed ? 0 : SEARCH_BYTES * file.chunks.length;
    new LoadBudget(bytes.length, limits).take(frameCount * (FRAME_BYTES + searched), name);
    const groups = groupsOf(file, framesPerSecond, frameCount);
    const first = await firstSplats(file);
    const bounds = { ...boundsOf(first), ...(file.up && { up: file.up }) };
    return new FourDgsClip(file, {
      ...{ framesPerSecond, frameCount, groups, still: [], bounds, byteLength: bytes.length },
      ...{ durationSeconds: frameCount / framesPerSecond, shDegree: header.shDegree, origin: file.origin },
      ...{ antialiased: false, grow: 1 },
    });
  }

  /**
   * Decodes a group, by its index. Each frame has the splats at the middle of its duration. Throws as {@link open} does.
   */
  async group(number: number): Promise<ClipPartContent> {
    const { first, frames } = this.index.groups[number];
    const times = Array.from({ length: frames }, (_, f) => (first + f + 0.5) / this.index.framesPerSecond);
    const moments = await (this.#file.isKeyed ? this.#keyedMoments(times) : this.#moments(times));
    return sampledMotion(moments);
  }

  /** Returns the visible splats at a time in seconds, as the specification defines. Throws as {@link open} does. */
  at(seconds: number): Promise<GaussianCloud> {
    return this.#file.cloudAt(seconds);
  }

  async #moments(times: readonly number[]): Promise<Moments> {
    const file = this.#file;
    const { splats } = await file.population(file.chunksWithin(times[0], times[times.length - 1]));
    const { cutoff } = file.scene.header;
    const rows = Array.from({ length: splats.count }, (_, i) => i).filter((i) =>
      times.some((seconds) => presence(splats, i, seconds, cutoff) > 0),
    );
    const list = rows.length > 0 ? rows : splats.count > 0 ? [0] : [];
    return this.#momentsOf(
      times,
      times.map(() => ({ splats, rows: list })),
    );
  }

  async #keyedMoments(times: readonly number[]): Promise<Moments> {
    const file = this.#file;
    const populations: Population[] = [];
    for (const seconds of times) populations.push(await file.keyedPopulation(file.stateAt(seconds)));
    const ids = [...new Set(populations.flatMap((own) => Array.from(own.ids!)))];
    const rowsIn = new Map(
      populations.map((own) => [own, new Map(Array.from(own.ids!, (id, row) => [id, row]))] as const),
    );
    return this.#momentsOf(
      times,
      populations.map((own) => ({ splats: own.splats, rows: ids.map((id) => rowsIn.get(own)!.get(id) ?? -1) })),
    );
  }

  #momentsOf(
    times: readonly number[],
    states: readonly { readonly splats: ChangingSplats; readonly rows: readonly number[] }[],
  ): Moments {
    const { header, name } = this.#file.scene;
    const { cutoff } = header;
    this.#file.budget().take(times.length * states[0].rows.length * momentBytes(header.shDegree), name);
    const isThere = states.map(({ splats, rows }, f) =>
      Uint8Array.from(rows, (row) => (row >= 0 && presence(splats, row, times[f], cutoff) > 0 ? 1 : 0)),
    );
    // A lifetime has one frame or more, so that splats that are never visible get one frame, with opacity 0.
    const { length } = states[0].rows;
    for (let k = 0; k < length; k++)
      if (!isThere.some((there) => there[k]))
        isThere[
          Math.max(
            0,
            states.findIndex(({ rows }) => rows[k] >= 0),
          )
        ][k] = 1;
    const clouds = states.map(({ splats, rows }, f) =>
      this.#file.cloudOf(
        splats,
        rows.map((row) => Math.max(0, row)),
        times[f],
      ),
    );
    return { clouds, isThere };
  }
}

async function firstSplats(file: FourDgs): Promise<GaussianCloud> {
  const first = file.chunks.findIndex(({ live }) => live > 0);
  const { splats } = await (file.isKeyed
    ? file.keyedPopulation(Math.max(0, first))
    : file.population([Math.max(0, first)]));
  if (splats.count === 0) throw damaged(file.scene.name, 'splats', 'none', 'decode/header');
  const cloud = file.cloudOf(
    splats,
    Array.from({ length: splats.count }, (_, i) => i),
    file.chunks[Math.max(0, first)].from,
  );
  return { ...cloud, opacities: splats.opacities };
}

/** Seconds for which the last state of a file without an end is played. */
const LAST_SECONDS = 1;

/** Returns the duration of a clip in seconds: that of the file, or up to its last change and a second more. */
function playedSeconds({ scene, chunks, isKeyed }: FourDgs): number {
  const { durationSeconds } = scene.header;
  if (durationSeconds < Infinity) return durationSeconds;
  const spans = chunks.map(({ from, until }) => [from, until]);
  const edges = isKeyed ? spans.flat() : [...spans, ...scene.windows].flat();
  return LAST_SECONDS + edges.reduce((last, edge) => (edge < 1e6 ? Math.max(last, edge) : last), 0);
}

/**
 * Returns the frame rate of a clip. If the edges of states or windows are at equal distances, each edge becomes that of a
 * frame. The rate is then a multiple of the rate of the edges, at least {@link MIN_RATE}.
 */
function rateOf(file: FourDgs): number {
  const spans = file.isKeyed ? file.chunks.map(({ from, until }) => [from, until]) : file.scene.windows;
  const edges = [...new Set(spans.flat())].filter((edge) => edge >= 0 && edge < 1e6).sort((a, b) => a - b);
  const steps = edges.slice(1).map((edge, k) => edge - edges[k]);
  const rate = 1 / steps.reduce((min, step) => Math.min(min, step), Infinity);
  const isEven = steps.length > 1 && steps.every((step) => Math.abs(step * rate - Math.round(step * rate)) < 0.01);
  if (!isEven || !(rate > 0 && rate <= MAX_RATE)) return USUAL_RATE;
  const whole = Math.abs(rate - Math.round(rate)) < 1e-3 ? Math.round(rate) || rate : rate;
  return whole * Math.ceil(MIN_RATE / whole);
}

/** Bytes of a splat in a frame while a group is converted. */
const momentBytes = (degree: ShDegree): number => 4 * (11 + 3 * shCoefficientCount(degree)) + MOMENT_BYTES;

/** Divides the frames into groups of the greatest length that memory allows. A keyframe begins a new group. */
function groupsOf(file: FourDgs, rate: number, frameCount: number): ClipGroup[] {
  let groups: ClipGroup[] = [];
  for (const max of GROUP_FRAMES) {
    groups = [];
    for (let first = 0; first < frameCount;) {
      const frames = Math.min(max, endOfGroup(file, first, rate, frameCount) - first);
      groups.push({ first, frames, parts: [partOf(file, first, frames, rate)] });
      first += frames;
    }
    // Converting a group takes more memory than its result.
    const allowed = file.budget().allowed / 2;
    const bytes = momentBytes(file.scene.header.shDegree);
    const fits = ({ frames, parts: [part] }: ClipGroup): boolean =>
      clipPartBytes(part) <= MAX_GROUP_BYTES && frames * part.splats * bytes <= allowed;
    if (groups.every(fits)) break;
  }
  return groups;
}

/** Returns the first frame of the next keyframe after frame `first`; `frameCount` if there is none. */
function endOfGroup(file: FourDgs, first: number, rate: number, frameCount: number): number {
  if (!file.isKeyed) return frameCount;
  const own = file.stateAt((first + 0.5) / rate);
  const next = file.keyframeAfter(own);
  return next < 0 ? frameCount : Math.max(first + 1, Math.round(file.chunks[next].from * rate - 1e-6));
}

/** Returns the part of a group with the maximum count of splats and planes. The part has no range of bytes in the file. */
function partOf(file: FourDgs, first: number, frames: number, rate: number): ClipGroup['parts'][number] {
  const [from, until] = [(first + 0.5) / rate, (first + frames - 0.5) / rate];
  const own = file.chunksWithin(from, until).map((k) => file.chunks[k]);
  const splats = file.isKeyed
    ? own.reduce((sum, { births }, k) => sum + (k === 0 ? 0 : births), own[0]?.live ?? 0)
    : own.reduce((sum, { live }) => sum + live, 0);
  // Splats without an object move along straight lines (3 planes), and fade (1 plane for each frame).
  const planes = file.isKeyed ? ALL_PLANES * frames : file.tracks.size > 0 ? 7 * frames : 3 + frames;
  return { start: 0, sceneBytes: 0, motionBytes: 0, splats: Math.max(1, splats), planes: Math.max(planes, 3) };
}
