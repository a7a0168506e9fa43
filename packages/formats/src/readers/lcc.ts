import { GaussianSplatError, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { grouped, viewOf } from '../bytes.js';
import { allocateCloud, SH_C0, type DraftCloud } from '../cloud.js';
import { damaged, warn } from '../faults.js';
import { checkedPart } from '../foreign-signatures.js';
import {
  HARMONICS_BYTES,
  parseLccIndex,
  parseLccMeta,
  SPLAT_BYTES,
  type LccMeta,
  type LccRanges,
  type LccRun,
} from '../lcc/meta.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import { optionalPart } from './optional-part.js';
import { noParts } from './sog.js';

const COEFFICIENTS = 15;

/**
 * Reads LCC of XGRIDS: a description (`.lcc`) with `index.bin`, `data.bin`, and perhaps `shcoef.bin` and
 * `environment.bin` beside it. The level of detail is `source.level`; 0 is the finest. The splats of the environment
 * are added at every level. The z axis points up, which becomes `hints.up`.
 */
export async function readLcc(source: SceneSource): Promise<GaussianCloud> {
  const { name, level = 0, maxSplats = Infinity, signal } = source;
  const meta = parseLccMeta(source);
  const part = partOpener(source);
  const index = await part('index.bin');
  const cells = parseLccIndex(index, meta.levels, `${name}, index.bin`);
  const countAt = (own: number): number => cells.reduce((sum, runs) => sum + runs[own].count, 0);
  let own = Math.min(level === 'all' ? 0 : level, meta.levels - 1);
  while (own < meta.levels - 1 && countAt(own) > maxSplats) own++;
  const data = await part('data.bin');
  if (SPLAT_BYTES * countAt(own) > data.length)
    throw damaged(
      `${name}, index.bin`,
      `at most ${grouped(Math.floor(data.length / SPLAT_BYTES))} splats`,
      grouped(countAt(own)),
    );
  const harmonics = meta.hasHarmonics ? await part('shcoef.bin') : undefined;
  signal?.throwIfAborted();
  const runs = cells.map((levels) => levels[own]).filter((run) => run.count > 0);
  const cloud = readRuns(runs, meta, data, harmonics, source);
  const around = await readAround(meta, part, source, cloud);
  const both = [cloud, ...(around ? [around] : [])].map((each) => ({ cloud: each, first: 0, count: each.count }));
  const whole = around ? mergeClouds(both, source) : cloud;
  whole.hints = { ...whole.hints, up: [0, 0, 1] };
  return whole;
}

type Account = Pick<SceneSource, 'budget' | 'name'>;

/**
 * Reads blocks of splats.
 * @param data Content of `data.bin`. @param harmonics Content of `shcoef.bin`, if the scene has it.
 * @throws GaussianSplatError `decode/truncated`, `out-of-memory/budget`
 */
export function readRuns(
  runs: readonly LccRun[],
  { ranges }: LccMeta,
  data: Uint8Array,
  harmonics: Uint8Array | undefined,
  source: Account,
): DraftCloud {
  const total = runs.reduce((sum, { count }) => sum + count, 0);
  const cloud = allocateCloud(total, harmonics ? 3 : 0, source);
  let first = 0;
  for (const run of runs) {
    requireRoom(data, run, SPLAT_BYTES, `${source.name}, data.bin`);
    if (harmonics) requireRoom(harmonics, run, HARMONICS_BYTES, `${source.name}, shcoef.bin`);
    const records = { bytes: data, start: run.start, stride: SPLAT_BYTES };
    const coefficients = harmonics && {
      ...{ bytes: harmonics, start: (run.start / SPLAT_BYTES) * HARMONICS_BYTES, stride: HARMONICS_BYTES },
    };
    unpack(records, coefficients, ranges, cloud, first, run.count);
    first += run.count;
  }
  return cloud;
}

type OpenPart = (path: string) => Promise<Uint8Array>;

function partOpener({ openFile, name }: SceneSource): OpenPart {
  const open = openFile ?? noParts(name, 'scene.zip');
  return async (path) => checkedPart(await open(path), `${name}, ${path}`);
}

/**
 * Reads the splats of `environment.bin`; undefined without any. The description does not say whether there is such a
 * file.
 * @param scene Cloud that gets a warning if the file cannot be read.
 */
export async function readAround(
  { hasHarmonics, around }: LccMeta,
  part: OpenPart,
  source: Account & Pick<SceneSource, 'signal'>,
  scene: DraftCloud,
): Promise<DraftCloud | undefined> {
  const path = 'environment.bin';
  const bytes = await optionalPart(part(path), source.signal);
  if (bytes instanceof Error) {
    if (bytes instanceof GaussianSplatError && /^network\/(?!status)/.test(bytes.code))
      warn(scene, `The surroundings (${path}) are left out: ${bytes.message}`);
    return undefined;
  }
  if (bytes.length === 0) return undefined;
  const stride = SPLAT_BYTES + (hasHarmonics ? HARMONICS_BYTES : 0);
  if (bytes.length % stride !== 0)
    throw damaged(
      `${source.name}, ${path}`,
      `splats of ${stride} bytes`,
      `${grouped(bytes.length)} bytes`,
      'decode/truncated',
    );
  const count = bytes.length / stride;
  const cloud = allocateCloud(count, hasHarmonics ? 3 : 0, source);
  const coefficients = hasHarmonics ? { bytes, start: SPLAT_BYTES, stride } : undefined;
  unpack({ bytes, start: 0, stride }, coefficients, around, cloud, 0, count);
  return cloud;
}

function requireRoom({ length }: Uint8Array, { start, count }: LccRun, bytes: number, name: string): void {
  const end = (start / SPLAT_BYTES + count) * bytes;
  if (end > length) throw damaged(name, `${grouped(end)} bytes`, grouped(length), 'decode/truncated');
}

/** Records of the same size: byte offset of the first one, and bytes from one to the next. */
interface Records {
  readonly bytes: Uint8Array;
  readonly start: number;
  readonly stride: number;
}

/** Writes splats to a cloud, from index `first` on. */
function unpack(
  records: Records,
  harmonics: Records | undefined,
  ranges: LccRanges,
  cloud: DraftCloud,
  first: number,
  count: number,
): void {
  const { positions, scales, rotations, opacities, sh, shDegree } = cloud;
  const { min, max } = ranges.scale;
  const view = viewOf(records.bytes);
  const stride = 3 * shCoefficientCount(shDegree);
  for (let k = 0; k < count; k++) {
    const at = records.start + records.stride * k;
    const i = first + k;
    for (let axis = 0; axis < 3; axis++) {
      positions[3 * i + axis] = view.getFloat32(at + 4 * axis, true);
      sh[stride * i + axis] = (view.getUint8(at + 12 + axis) / 255 - 0.5) / SH_C0;
      scales[3 * i + axis] = mix(min[axis], max[axis], view.getUint16(at + 16 + 2 * axis, true) / 65_535);
    }
    opacities[i] = view.getUint8(at + 15) / 255;
    unpackRotation(view.getUint32(at + 22, true), rotations, 4 * i);
  }
  if (harmonics) unpackHarmonics(harmonics, ranges, sh.subarray(stride * first), stride, count);
}

const mix = (a: number, b: number, t: number): number => a * (1 - t) + b * t;

/**
 * Decodes a quaternion (w, x, y, z). The highest 2 bits of the word are the index in (x, y, z, w) of the largest
 * component, which is not stored. The others have 10 bits each, from -1/sqrt(2) to 1/sqrt(2); the lowest bits are the
 * first of them.
 */
function unpackRotation(word: number, out: Float32Array, at: number): void {
  const largest = word >>> 30;
  let squares = 0;
  for (let component = 0, shift = 0; component < 4; component++) {
    if (component === largest) continue;
    const value = (((word >>> shift) & 1023) / 1023 - 0.5) * Math.SQRT2;
    out[at + ((component + 1) & 3)] = value;
    squares += value * value;
    shift += 10;
  }
  out[at + ((largest + 1) & 3)] = Math.sqrt(Math.max(0, 1 - squares));
}

/** Writes coefficients: a word for each, with 11 bits of red, which are the lowest, 10 of green, and 11 of blue. */
function unpackHarmonics(
  { bytes, start, stride: recordBytes }: Records,
  { harmonics: { min, max } }: LccRanges,
  sh: Float32Array,
  stride: number,
  count: number,
): void {
  const view = viewOf(bytes);
  for (let k = 0; k < count; k++) {
    for (let c = 0; c < COEFFICIENTS; c++) {
      const word = view.getUint32(start + recordBytes * k + 4 * c, true);
      const to = stride * k + 3 * (c + 1);
      sh[to] = mix(min[0], max[0], (word & 2047) / 2047);
      sh[to + 1] = mix(min[1], max[1], ((word >>> 11) & 1023) / 1023);
      sh[to + 2] = mix(min[2], max[2], (word >>> 21) / 2047);
    }
  }
}
