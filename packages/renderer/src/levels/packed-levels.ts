import type { GaussianCloud } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { constants } from '../generated/shaders.js';
import { packGaussians, type PackedGaussians, type PackOptions } from '../pack/pack.js';
import { buildLevelsAbove, finish } from './build-levels.js';
import { boundLevel, detailRows, DETAIL_NUMBERS, leafErrors, parentErrors, type ChunkErrors } from './chunk-detail.js';
import { packFiller, packLevelGeometry, packLevelSh } from './pack-level.js';
import { chunksOf, type SplatLevel, FACTOR_NUMBERS, type LevelSource } from './splat-level.js';
import { shReader, unpackSplat } from '../pack/unpack.js';
import { padded } from '../pack/padded.js';
import { GEOMETRY_WORDS, shWords } from '../pack/words.js';

/**
 * Returns the splats of a packed scene as the finest level. The source of the scene, a file or generator, is not
 * required.
 */
export function packedLeaves(packed: PackedGaussians): LevelSource {
  const { count, geometry, shDegree, antialiased, filterVariance = constants.DILATION } = packed;
  const positions = new Float32Array(3 * count);
  const factors = new Float32Array(FACTOR_NUMBERS * count);
  const opacities = new Float32Array(count);
  for (let i = 0; i < count; i++) unpackSplat(geometry, i, positions, factors, opacities);
  const dilation = antialiased ? 0 : filterVariance;
  const spreads = new Float32Array(count);
  return { count, positions, factors, opacities, spreads, shDegree, dilation, readSh: shReader(packed) };
}

const { CULL_GROUP } = constants;

/**
 * The coarser levels of a packed scene, without the scene itself. Plain data with transferable buffers, so that a
 * worker can build it.
 */
export interface PackedLevels {
  /** [ceil(N / 256), 12] `ChunkDetail` of each chunk of the scene itself */
  readonly leafDetails: Float32Array;
  /** All coarser levels in sequence, finest first, with their `details`. Each level starts a new chunk. */
  readonly coarser: PackedGaussians;
}

/**
 * Builds the levels of detail of a packed scene: a third as many splats, which replace groups of four, sixteen and
 * more. Each step takes about ten milliseconds: call `next()` until `done`. The result is undefined for a scene that is
 * too small for levels.
 */
export function* buildPackedLevels(leaves: PackedGaussians): Generator<void, PackedLevels | undefined> {
  if (chunksOf(leaves.count) <= 1) return undefined;
  const levels = yield* buildLevelsAbove(packedLeaves(leaves));
  const chunks = [leaves.chunks, ...levels.map(boundLevel)];
  const details = detailsOf(levels, chunks);
  const count = CULL_GROUP * levels.reduce((sum, level) => sum + chunksOf(level.count), 0);
  const coarser = {
    ...{ ...leaves, count, droppedCount: 0, leafCount: undefined },
    geometry: new Uint32Array(GEOMETRY_WORDS * count),
    sh: new Uint32Array(shWords(leaves.shDegree, leaves.shPrecision) * count),
    chunks: concatenated(Float32Array, chunks.slice(1)),
    details: concatenated(Float32Array, details.slice(1)),
  };
  yield* packLevels(levels, coarser);
  return { leafDetails: details[0], coarser };
}

/** Number of splats packed in one step. */
const PACKED_A_STEP = 64 * CULL_GROUP;

function* packLevels(levels: readonly SplatLevel[], { geometry, sh, shPrecision }: PackedGaussians): Generator<void> {
  let start = 0;
  for (const level of levels) {
    const stride = shWords(level.shDegree, shPrecision);
    for (let from = 0; from < level.count; from += PACKED_A_STEP) {
      const end = Math.min(level.count, from + PACKED_A_STEP);
      packLevelGeometry(level, geometry, start + from, from, end);
      sh.set(packLevelSh(level, shPrecision, from, end), stride * (start + from));
      yield;
    }
    const end = start + CULL_GROUP * chunksOf(level.count);
    packFiller(geometry, start + level.count, end);
    start = end;
  }
}

/** Returns the detail rows of each level, the scene itself first. */
function detailsOf(levels: readonly SplatLevel[], chunks: readonly Float32Array[]): Float32Array[] {
  const errors: ChunkErrors[] = [leafErrors(chunks[0])];
  levels.forEach((level, k) => errors.push(parentErrors(level, chunks[k + 1], errors[k])));
  return errors.map((own, k) => detailRows(own, errors[k + 1]));
}

/** Returns one packed scene that contains a scene and its coarser levels. */
export function joinLevels(leaves: PackedGaussians, { leafDetails, coarser }: PackedLevels): PackedGaussians {
  const start = CULL_GROUP * (leafDetails.length / DETAIL_NUMBERS);
  const count = start + coarser.count;
  const stride = shWords(leaves.shDegree, leaves.shPrecision);
  const joined = padded(leaves, count);
  joined.geometry.set(coarser.geometry, GEOMETRY_WORDS * start);
  packFiller(joined.geometry, leaves.count, start);
  joined.sh.set(coarser.sh, stride * start);
  joined.chunks.set(coarser.chunks, leaves.chunks.length);
  const details = concatenated(Float32Array, [leafDetails, coarser.details!]);
  return { ...joined, details, leafCount: leaves.count };
}

/**
 * Packs a cloud with all its levels of detail. The splats of {@link packGaussians}, in the same order, are followed by
 * a third as many that replace groups of four, sixteen and more. The settings `detail` and `splatBudget` select among
 * them; with neither the image is that of {@link packGaussians}.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function packWithDetail(given: GaussianCloud, options: PackOptions = {}): PackedGaussians {
  const packed = packGaussians(given, options);
  const levels = finish(buildPackedLevels(packed));
  return levels === undefined ? packed : joinLevels(packed, levels);
}
