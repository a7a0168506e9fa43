/**
 * Head and index of clips (.gsv): animated scenes in one file, read by byte ranges. docs/sequences.md describes the
 * format.
 */
import {
  GaussianSplatError,
  type Bounds,
  type Credits,
  type FilterRule,
  type ShDegree,
  type Vector3,
} from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from './budget.js';
import { grouped, startsWith, viewOf } from './bytes.js';
import { creditsOf } from './credits.js';
import { damaged } from './faults.js';
import { isObject, parseJson, show, type Json } from './json.js';
import { ANIMATED_ATTRIBUTES, ANIMATED_ATTRIBUTE_NAMES } from './motion.js';

const MAGIC = 'GSV\n';
/** Versions of files. Those of version 1 have no splats that never change, and motion of version 2 or 3. */
const VERSIONS = [1, 2];
/** Size of the head in bytes: the magic number, the version, and the size of the index, each of 4 bytes. */
export const CLIP_HEAD_BYTES = 12;
export const MAX_CLIP_INDEX_BYTES = 1 << 24;
const MAX_GROUP_FRAMES = 4096;
const MAX_PARTS = 8;
/** Maximum numbers of groups, and of their parts together, because the page gets each as an object. */
const MAX_GROUPS = 32_768;
const MAX_ALL_PARTS = 65_536;
/** Maximum number of code planes for each frame of a group: one for each animated number of a splat. */
const PLANES_PER_FRAME = ANIMATED_ATTRIBUTE_NAMES.reduce((sum, name) => sum + ANIMATED_ATTRIBUTES[name], 0);

/** Some of the splats of a group: their scene file and their motion, which are adjacent in the clip. */
export interface ClipPart {
  /** Byte offset of the part's scene in the clip file. The part's motion follows the scene. */
  readonly start: number;
  /** Size in bytes of the part's scene, a scene file of any format. */
  readonly sceneBytes: number;
  /** Size in bytes of the part's motion, which `readMotion` reads; 0 if its splats never change. */
  readonly motionBytes: number;
  readonly splats: number;
  /** Number of code planes in the motion. A plane has one Int16 for each splat. */
  readonly planes: number;
}

/** Consecutive frames of a clip that are decoded without other groups. */
export interface ClipGroup {
  /** Index in the clip of the group's first frame. */
  readonly first: number;
  readonly frames: number;
  /** Parts of the group, 1 to 8, each with different splats. The first part alone is a coarse version of the scene. */
  readonly parts: readonly ClipPart[];
}

/** Index at the beginning of a clip file: properties of all frames, and the groups of frames. */
export interface ClipIndex extends FilterRule {
  readonly framesPerSecond: number;
  readonly frameCount: number;
  readonly durationSeconds: number;
  readonly shDegree: ShDegree;
  readonly origin: Vector3;
  readonly bounds: Bounds & { readonly up?: Vector3 | undefined };
  /** Credits of all frames. The index has them as `attribution` and `license`. */
  readonly credits?: Credits | undefined;
  /** Factor of the scales of the first part's splats while other parts of its group are missing, 1 to 8. */
  readonly grow: number;
  readonly groups: readonly ClipGroup[];
  /** Parts with the splats that never change, which every frame has: none, or up to 8; the first is coarse. */
  readonly still: readonly ClipPart[];
  /** Size of the whole file in bytes. */
  readonly byteLength: number;
}

/** Input of {@link writeClipHead}: an index without the properties that follow from its lengths. */
export interface ClipHead extends Omit<
  ClipIndex,
  'groups' | 'still' | 'byteLength' | 'frameCount' | 'durationSeconds'
> {
  readonly still?: readonly Omit<ClipPart, 'start'>[];
  readonly groups: readonly {
    readonly frames: number;
    readonly parts: readonly Omit<ClipPart, 'start'>[];
  }[];
}

/**
 * Returns the size in bytes of the index, which follows the head.
 * @param head Beginning of the file, at least {@link CLIP_HEAD_BYTES}.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/unsupported`
 */
export function clipIndexBytes(head: Uint8Array, name: string): number {
  if (head.length < CLIP_HEAD_BYTES)
    throw damaged(name, `a head of ${CLIP_HEAD_BYTES} bytes`, grouped(head.length), 'decode/truncated');
  if (!startsWith(head, MAGIC)) throw damaged(name, 'a clip', 'another file', 'decode/header');
  const view = viewOf(head);
  const [version, length] = [view.getUint32(4, true), view.getUint32(8, true)];
  if (!VERSIONS.includes(version))
    throw damaged(name, `a clip of version ${VERSIONS.join(' or ')}`, `version ${version}`, 'decode/unsupported');
  if (length > MAX_CLIP_INDEX_BYTES)
    throw damaged(name, `an index of at most ${grouped(MAX_CLIP_INDEX_BYTES)} bytes`, grouped(length), 'decode/header');
  return length;
}

/**
 * Parses the head and the index of a clip.
 * @param bytes Beginning of the file, at least up to the end of the index.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`, `decode/unsupported`,
 * `out-of-memory/budget`
 */
export function parseClip(bytes: Uint8Array, name: string, limits: LoadLimits = {}): ClipIndex {
  const length = clipIndexBytes(bytes, name);
  const own = bytes.subarray(CLIP_HEAD_BYTES, CLIP_HEAD_BYTES + length);
  if (own.length < length)
    throw damaged(name, `an index of ${grouped(length)} bytes`, grouped(own.length), 'decode/truncated');
  const json = parseJson({ bytes: own, name, budget: new LoadBudget(length, limits) }, MAX_CLIP_INDEX_BYTES);
  return new IndexReader(json, name).read(CLIP_HEAD_BYTES + length);
}

/** Validates the JSON of an index, and converts it to a {@link ClipIndex}. */
class IndexReader {
  readonly #json: Json;
  readonly #name: string;

  constructor(json: Json, name: string) {
    this.#json = json;
    this.#name = name;
  }

  read(start: number): ClipIndex {
    const { origin = [0, 0, 0], antialiased = false, filterVariance, groups, bounds } = this.#json;
    const framesPerSecond = this.#number('framesPerSecond', this.#json.framesPerSecond, 1e-3, 1000);
    const shDegree = this.#whole('shDegree', this.#json.shDegree ?? 0, 0, 3) as ShDegree;
    if (!Array.isArray(groups) || groups.length < 1 || groups.length > MAX_GROUPS)
      this.#fail('groups', `1 to ${grouped(MAX_GROUPS)} groups`, groups);
    const found: ClipGroup[] = [];
    const still = this.#still(this.#json.still, start);
    let [first, at, count] = [0, endOf(still, start), still.length];
    for (const [k, group] of (groups as unknown[]).entries()) {
      const own = this.#group(`groups[${k}]`, group, first, at);
      found.push(own);
      count += own.parts.length;
      if (count > MAX_ALL_PARTS) this.#fail('groups', `at most ${grouped(MAX_ALL_PARTS)} parts`, count);
      first += own.frames;
      at = endOf(own.parts, at);
    }
    if (!Number.isSafeInteger(at)) this.#fail('groups', 'a file whose bytes can be counted', at);
    return {
      ...{ framesPerSecond, shDegree, groups: found, still, byteLength: at },
      ...{ frameCount: first, durationSeconds: first / framesPerSecond },
      origin: this.#vector('origin', origin),
      bounds: this.#bounds(bounds),
      antialiased: antialiased === true,
      filterVariance: filterVariance === undefined ? undefined : this.#number('filterVariance', filterVariance, 0, 100),
      grow: this.#number('grow', this.#json.grow ?? 1, 1, 8),
      credits: creditsOf(this.#json),
    };
  }

  /** Reads the row of a group: `[frames, [splats, planes, bytes of the scene, bytes of the motion], ...]`. */
  #group(path: string, group: unknown, first: number, start: number): ClipGroup {
    if (!Array.isArray(group) || group.length < 2 || group.length > 1 + MAX_PARTS)
      this.#fail(path, `frames, and 1 to ${MAX_PARTS} parts`, group);
    const [asked, ...rest] = group as unknown[];
    const frames = this.#whole(`${path}[0]`, asked, 1, MAX_GROUP_FRAMES);
    let at = start;
    const parts = rest.map((part, k): ClipPart => {
      const own = `${path}[${k + 1}]`;
      if (!Array.isArray(part) || part.length !== 4) this.#fail(own, 'splats, planes, and two lengths in bytes', part);
      const [splats, planes, sceneBytes, motionBytes] = part as unknown[];
      const found = {
        start: at,
        splats: this.#whole(`${own}[0]`, splats, 1, 2 ** 28),
        planes: this.#whole(`${own}[1]`, planes, 0, PLANES_PER_FRAME * frames),
        sceneBytes: this.#whole(`${own}[2]`, sceneBytes, 1, 2 ** 31),
        motionBytes: this.#whole(`${own}[3]`, motionBytes, 1, 2 ** 31),
      };
      at += found.sceneBytes + found.motionBytes;
      return found;
    });
    return { first, frames, parts };
  }

  /** Reads the row of the splats that never change: `[[splats, bytes of the scene], ...]`. */
  #still(rows: unknown, start: number): ClipPart[] {
    if (rows === undefined) return [];
    if (!Array.isArray(rows) || rows.length > MAX_PARTS) this.#fail('still', `up to ${MAX_PARTS} parts`, rows);
    let at = start;
    return (rows as unknown[]).map((row, k): ClipPart => {
      const own = `still[${k}]`;
      if (!Array.isArray(row) || row.length !== 2) this.#fail(own, 'splats, and a length in bytes', row);
      const [splats, bytes] = row as unknown[];
      const found = {
        ...{ start: at, planes: 0, motionBytes: 0 },
        splats: this.#whole(`${own}[0]`, splats, 1, 2 ** 28),
        sceneBytes: this.#whole(`${own}[1]`, bytes, 1, 2 ** 31),
      };
      at += found.sceneBytes;
      return found;
    });
  }

  #bounds(bounds: unknown): ClipIndex['bounds'] {
    if (!isObject(bounds)) return this.#fail('bounds', 'min, max, center and radius', bounds);
    const { min, max, center, radius, up } = bounds;
    return {
      min: this.#vector('bounds.min', min),
      max: this.#vector('bounds.max', max),
      center: this.#vector('bounds.center', center),
      radius: this.#number('bounds.radius', radius, Number.MIN_VALUE, 1e18),
      ...(up !== undefined && { up: this.#vector('bounds.up', up) }),
    };
  }

  #vector(path: string, value: unknown): Vector3 {
    if (
      Array.isArray(value) &&
      value.length === 3 &&
      value.every((each) => typeof each === 'number' && Math.abs(each) <= 1e18)
    )
      return value as unknown as Vector3;
    return this.#fail(path, 'three numbers', value);
  }

  #number(path: string, value: unknown, min: number, max: number): number {
    const isNumber = typeof value === 'number' && value >= min && value <= max;
    return isNumber ? value : this.#fail(path, `a number from ${min} to ${max}`, value);
  }

  #whole(path: string, value: unknown, min: number, max: number): number {
    if (Number.isInteger(value)) return this.#number(path, value, min, max);
    return this.#fail(path, `a whole number from ${min} to ${grouped(max)}`, value);
  }

  #fail(path: string, expected: string, found: unknown): never {
    throw damaged(`${this.#name}, ${path}`, expected, show(found), 'decode/header');
  }
}

/** Returns the byte offset of the end of consecutive parts. */
function endOf(parts: readonly ClipPart[], start: number): number {
  return parts.reduce((end, { sceneBytes, motionBytes }) => end + sceneBytes + motionBytes, start);
}

/**
 * Returns the bytes of head and index. In the file, the parts that never change follow, then the groups: the scene and the motion of each part follow in order.
 * @throws GaussianSplatError `argument/value` for an index that {@link parseClip} would refuse for its size.
 */
export function writeClipHead({ groups, still = [], credits, ...facts }: ClipHead): Uint8Array<ArrayBuffer> {
  requireAtMost(groups.length, MAX_GROUPS, 'groups');
  requireAtMost(
    groups.reduce((sum, { parts }) => sum + parts.length, 0),
    MAX_ALL_PARTS,
    'parts of groups',
  );
  const rows = groups.map(({ frames, parts }) => [
    frames,
    ...parts.map(({ splats, planes, sceneBytes, motionBytes }) => [splats, planes, sceneBytes, motionBytes]),
  ]);
  const stillRows = still.map(({ splats, sceneBytes }) => [splats, sceneBytes]);
  const json = { ...facts, ...credits, ...(still.length > 0 && { still: stillRows }), groups: rows };
  const index = new TextEncoder().encode(JSON.stringify(json));
  requireAtMost(index.length, MAX_CLIP_INDEX_BYTES, 'bytes');
  const bytes = new Uint8Array(CLIP_HEAD_BYTES + index.length);
  bytes.set(new TextEncoder().encode(MAGIC));
  const view = viewOf(bytes);
  view.setUint32(4, VERSIONS[VERSIONS.length - 1], true);
  view.setUint32(8, index.length, true);
  bytes.set(index, CLIP_HEAD_BYTES);
  return bytes;
}

function requireAtMost(value: number, max: number, what: string): void {
  if (value <= max) return;
  throw new GaussianSplatError('argument/value', {
    where: 'index of a clip',
    expected: `at most ${grouped(max)} ${what}`,
    found: grouped(value),
    remedy: 'put more frames into a group, or divide the clip',
  });
}

/** Returns the index of the group that contains a frame. The frame index counts from 0 and must be within the clip. */
export function clipGroupAt({ groups }: Pick<ClipIndex, 'groups'>, frame: number): number {
  let [low, high] = [0, groups.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (groups[middle].first <= frame) low = middle;
    else high = middle - 1;
  }
  return low;
}
