import { validateCloud, type GaussianCloud, type LevelRun } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { packKept, usableIndices, type PackedGaussians, type PackOptions } from '../pack/pack.js';
import { recentered } from '../pack/recenter.js';
import { mortonOrder } from '../pack/morton.js';
import { choosePrecision, noiseIn } from '../pack/sh.js';
import { detailRows, DETAIL_NUMBERS, type ChunkErrors } from '../levels/chunk-detail.js';
import { packFiller } from '../levels/pack-level.js';
import { errorsOfSpacings, spacingOf } from './run-errors.js';
import { chunksOf } from '../levels/splat-level.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from '../pack/words.js';

const { CULL_GROUP } = constants;

/** A run of usable splats in Morton order. */
interface PackedRun extends LevelRun {
  /** Indices of the splats in the cloud. */
  readonly kept: Uint32Array;
  /** Spacing of the splats in world units: see {@link spacingOf}. */
  readonly spacing: number;
}

/**
 * Packs a cloud whose file has its own levels of detail (`levelRuns`). Each run starts a new chunk. The screen error of
 * each run selects the level of a node, as with other levels of detail.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function packLevelRuns(given: GaussianCloud, options: PackOptions = {}): PackedGaussians {
  validateCloud(given);
  const cloud = recentered(given);
  const usable = usableIndices(cloud);
  const { sh = 'auto' } = options;
  const droppedCount = cloud.droppedCount + cloud.count - usable.length;
  return {
    ...packRuns(cloud, usable, sh === 'auto' ? choosePrecision(noiseIn(cloud, usable), usable.length) : sh),
    droppedCount,
  };
}

function packRuns(
  cloud: GaussianCloud,
  usable: Uint32Array,
  shPrecision: ShPrecision,
): Omit<PackedGaussians, 'droppedCount'> {
  const runs = keptRuns(cloud, usable);
  const count = CULL_GROUP * runs.reduce((sum, { kept }) => sum + chunksOf(kept.length), 0);
  const { shDegree, antialiased, filterVariance, origin } = cloud;
  const stride = shWords(shDegree, shPrecision);
  const packed = {
    ...{ count, shDegree, shPrecision, antialiased, filterVariance, origin },
    geometry: new Uint32Array(GEOMETRY_WORDS * count),
    sh: new Uint32Array(stride * count),
    chunks: new Float32Array((CHUNK_NUMBERS * count) / CULL_GROUP),
    details: new Float32Array((DETAIL_NUMBERS * count) / CULL_GROUP),
    leafCount: finestOf(runs).reduce((sum, { kept }) => sum + kept.length, 0),
  };
  let start = 0;
  const firstChunks = runs.map(({ kept }) => {
    const part = packKept(cloud, kept, shPrecision);
    packed.geometry.set(part.geometry, GEOMETRY_WORDS * start);
    packed.sh.set(part.sh, stride * start);
    packed.chunks.set(part.chunks, (CHUNK_NUMBERS * start) / CULL_GROUP);
    const end = start + CULL_GROUP * chunksOf(kept.length);
    packFiller(packed.geometry, start + kept.length, end);
    const firstChunk = start / CULL_GROUP;
    start = end;
    return firstChunk;
  });
  writeDetails(packed, runs, firstChunks);
  return packed;
}

/** Returns the non-empty runs; those of one node are consecutive, the finest first. */
function keptRuns({ positions, levelRuns = [] }: GaussianCloud, usable: Uint32Array): PackedRun[] {
  const byPlace = [...levelRuns].sort((a, b) => a.first - b.first);
  let at = 0;
  return byPlace
    .map((run) => {
      const from = at;
      while (at < usable.length && usable[at] < run.first + run.count) at++;
      const kept = mortonOrder(positions, usable.slice(from, at));
      return { ...run, kept, spacing: spacingOf(positions, kept) };
    })
    .filter(({ kept }) => kept.length > 0)
    .sort((a, b) => a.node - b.node || a.level - b.level);
}

const finestOf = (runs: readonly PackedRun[]): PackedRun[] => runs.filter(({ node }, r) => runs[r - 1]?.node !== node);

/**
 * Writes the details of all chunks. All levels of a node have one sphere, so that only their errors select a level.
 * @param firstChunks Index of the first chunk of each run, and the total.
 */
function writeDetails(
  { chunks, details = new Float32Array(0) }: Pick<PackedGaussians, 'chunks' | 'details'>,
  runs: readonly PackedRun[],
  firstChunks: readonly number[],
): void {
  for (let from = 0; from < runs.length;) {
    let end = from + 1;
    while (end < runs.length && runs[end].node === runs[from].node) end++;
    const errors = errorsOfSpacings(runs.slice(from, end).map(({ spacing }) => spacing));
    const lastChunk = firstChunks[end - 1] + chunksOf(runs[end - 1].kept.length);
    const sphere = sphereAround(chunks, firstChunks[from], lastChunk);
    const one = (error: number): ChunkErrors => ({ count: 1, spheres: sphere, errors: Float32Array.of(error) });
    for (let r = from; r < end; r++) {
      const row = detailRows(one(errors[r - from]), r + 1 < end ? one(errors[r + 1 - from]) : undefined);
      for (let c = 0; c < chunksOf(runs[r].kept.length); c++) details.set(row, DETAIL_NUMBERS * (firstChunks[r] + c));
    }
    from = end;
  }
}

/** Returns center and radius of a sphere around the boxes of chunks `first` to `end`. */
function sphereAround(chunks: Float32Array, first: number, end: number): Float32Array {
  const corner = (axis: number, place: number, pick: (a: number, b: number) => number): number => {
    let found = chunks[CHUNK_NUMBERS * first + place + axis];
    for (let c = first; c < end; c++) found = pick(found, chunks[CHUNK_NUMBERS * c + place + axis]);
    return found;
  };
  const low = [0, 1, 2].map((axis) => corner(axis, 0, Math.min));
  const high = [0, 1, 2].map((axis) => corner(axis, 4, Math.max));
  const center = low.map((x, axis) => (x + high[axis]) / 2);
  return Float32Array.of(...center, Math.hypot(...high.map((x, axis) => x - center[axis])));
}
