import type { GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { boundChunks } from '../pack/chunks.js';
import { packGeometry } from '../pack/pack.js';
import { packSh } from '../pack/sh.js';
import { detailRows, DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { SLOT_CHUNKS, pageLayout, type PageFormat } from './manifest.js';
import { packFiller } from '../levels/pack-level.js';
import { packQuantizedChunk, QUANTIZED_CHUNK_WORDS, widenReach } from './quantized-geometry.js';
import { chunksOf, FACTOR_NUMBERS, putShapes, type SplatShapes } from '../levels/splat-level.js';
import { CHUNK_NUMBERS } from '../pack/words.js';

const { CULL_GROUP } = constants;

/** Packed splats of a run in whole chunks. The last chunk is padded with splats of opacity 0. */
export interface RunWords {
  readonly geometry: Uint32Array;
  readonly sh: Uint32Array;
  readonly chunks: Float32Array;
}

/** A packed run whose chunks share one sphere and one error. */
export interface PackedRun extends RunWords {
  /** Center and radius in world units, relative to the origin of the scene. */
  readonly sphere: readonly number[];
  /** Error in world units. */
  readonly error: number;
}

/**
 * Packs splats of a cloud in the given order.
 * @param kept Indices of the splats.
 * @param place Box of a run that may have no drawable splats: it then becomes one empty chunk, which finer levels can
 * replace.
 */
export function packRun(
  cloud: GaussianCloud,
  kept: Uint32Array,
  { shPrecision, geometry }: Pick<PageFormat, 'shPrecision' | 'geometry'>,
  place?: { readonly min: readonly number[]; readonly max: readonly number[] },
): RunWords {
  const count = Math.max(place ? 1 : 0, chunksOf(kept.length));
  const layout = pageLayout({ shDegree: cloud.shDegree, shPrecision, geometry }, count);
  const words: RunWords = {
    geometry: new Uint32Array(layout.geometry),
    sh: new Uint32Array(layout.sh),
    chunks: new Float32Array(layout.chunks),
  };
  words.sh.set(packSh(cloud, kept, shPrecision));
  words.chunks.set(boundChunks(cloud, kept));
  if (geometry === 'quantized') quantizeRun(words, cloud, kept);
  else words.geometry.set(packGeometry(cloud, kept));
  if (place && kept.length === 0) words.chunks.set([...place.min, 0, ...place.max, 0]);
  if (geometry !== 'quantized') packFiller(words.geometry, kept.length, CULL_GROUP * count);
  return words;
}

/** Shapes of one chunk: memory that all calls share. */
const shapes: SplatShapes = {
  positions: new Float32Array(3 * CULL_GROUP),
  factors: new Float32Array(FACTOR_NUMBERS * CULL_GROUP),
  opacities: new Float32Array(CULL_GROUP),
};

function quantizeRun({ geometry, chunks }: RunWords, cloud: GaussianCloud, kept: Uint32Array): void {
  for (let c = 0; CULL_GROUP * c < kept.length; c++) {
    const end = Math.min(kept.length, CULL_GROUP * (c + 1));
    putShapes(cloud, kept, CULL_GROUP * c, end, shapes);
    packQuantizedChunk(shapes, geometry, QUANTIZED_CHUNK_WORDS * c, 0, end - CULL_GROUP * c);
    widenReach(chunks, CHUNK_NUMBERS * c);
  }
}

/**
 * Joins runs slot by slot, in the layout of docs/lod-format.md. All slots except the last are full. Their chunks have
 * no parent.
 */
export function joinSlots(runs: readonly PackedRun[], format: PageFormat): Uint32Array<ArrayBuffer> {
  const total = runs.reduce((sum, { chunks }) => sum + chunks.length / CHUNK_NUMBERS, 0);
  const words = new Uint32Array(pageLayout(format, 1).total * total);
  const floats = new Float32Array(words.buffer);
  const one = pageLayout(format, 1);
  let at = 0;
  for (const { geometry, sh, chunks, sphere, error } of runs) {
    const errors = { count: 1, spheres: Float32Array.from(sphere), errors: Float32Array.of(error) };
    const row = detailRows(errors, undefined);
    for (let c = 0; c < chunks.length / CHUNK_NUMBERS; c++, at++) {
      const slot = at - (at % SLOT_CHUNKS);
      const layout = pageLayout(format, Math.min(SLOT_CHUNKS, total - slot));
      const [start, k] = [one.total * slot, at - slot];
      const part = <T>(values: { subarray(from: number, end: number): T }, size: number): T =>
        values.subarray(size * c, size * (c + 1));
      floats.set(part(chunks, one.chunks), start + one.chunks * k);
      floats.set(row, start + layout.chunks + DETAIL_NUMBERS * k);
      const geometryAt = start + layout.chunks + layout.details;
      words.set(part(geometry, one.geometry), geometryAt + one.geometry * k);
      words.set(part(sh, one.sh), geometryAt + layout.geometry + one.sh * k);
    }
  }
  return words;
}
