import type { GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { CHUNK_NUMBERS } from '../pack/chunks.js';
import { GEOMETRY_WORDS, packUsable, type PackedGaussians, type PackOptions } from '../pack/pack.js';
import { shWords } from '../pack/sh.js';
import { levelsAbove, nextLevel } from './build-levels.js';
import { boundLevel, detailRows, leafErrors, parentErrors, DETAIL_NUMBERS, type ChunkErrors } from './chunk-detail.js';
import { packFiller, packLevelGeometry, packLevelSh } from './pack-level.js';
import { chunksOf, leafLevel, type SplatLevel } from './splat-level.js';

const { CULL_GROUP } = constants;

/**
 * Packs a cloud with all its levels of detail: the splats of {@link packGaussians}, in the same places, and behind them a third as many that stand
 * for four, sixteen and more of them. The levers `detail` and `splatBudget` choose among them; with neither the image is the same.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function packWithDetail(given: GaussianCloud, options: PackOptions = {}): PackedGaussians {
  const { packed, cloud, kept } = packUsable(given, options);
  if (chunksOf(packed.count) <= 1) return packed;
  const levels = [...levelsAbove(nextLevel(leafLevel(cloud, kept)))];
  const chunks = [packed.chunks, ...levels.map(boundLevel)];
  return { ...packed, ...joinLevels(packed, levels, chunks), chunks: concatenated(chunks), leafCount: packed.count };
}

/** Geometry, harmonics and details of all levels, each from a chunk's start on. */
function joinLevels(
  leaves: PackedGaussians,
  levels: readonly SplatLevel[],
  chunks: readonly Float32Array[],
): Pick<PackedGaussians, 'count' | 'geometry' | 'sh' | 'details'> {
  const totalChunks = chunks.reduce((sum, { length }) => sum + length, 0) / CHUNK_NUMBERS;
  const stride = shWords(leaves.shDegree, leaves.shPrecision);
  const count = CULL_GROUP * totalChunks;
  const geometry = new Uint32Array(GEOMETRY_WORDS * count);
  const sh = new Uint32Array(stride * count);
  geometry.set(leaves.geometry);
  sh.set(leaves.sh);
  let at = CULL_GROUP * chunksOf(leaves.count);
  packFiller(geometry, leaves.count, at);
  for (const level of levels) {
    packLevelGeometry(level, geometry, at);
    sh.set(packLevelSh(level, leaves.shPrecision), stride * at);
    const end = at + CULL_GROUP * chunksOf(level.count);
    packFiller(geometry, at + level.count, end);
    at = end;
  }
  return { count, geometry, sh, details: detailsOf(levels, chunks, totalChunks) };
}

function detailsOf(levels: readonly SplatLevel[], chunks: readonly Float32Array[], total: number): Float32Array {
  const errors: ChunkErrors[] = [leafErrors(chunks[0])];
  levels.forEach((level, k) => errors.push(parentErrors(level, chunks[k + 1], errors[k])));
  const rows = new Float32Array(DETAIL_NUMBERS * total);
  let at = 0;
  errors.forEach((own, k) => {
    rows.set(detailRows(own, errors[k + 1]), at);
    at += DETAIL_NUMBERS * own.count;
  });
  return rows;
}

function concatenated(parts: readonly Float32Array[]): Float32Array {
  const whole = new Float32Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
