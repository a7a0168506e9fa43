/** The format of packed scenes and LOD pages, for tools that write or read them. */
export { constants } from './generated/shaders.js';
export { levelsAbove } from './levels/build-levels.js';
export {
  boundLevel,
  detailRows,
  DETAIL_NUMBERS,
  ENDLESS,
  leafErrors,
  parentErrors,
  type ChunkErrors,
} from './levels/chunk-detail.js';
export { packFiller, packLevelGeometry, packLevelSh } from './levels/pack-level.js';
export { chunksOf, emptyLevel, FACTOR_NUMBERS, leafLevel, shNumbers, type SplatLevel } from './levels/splat-level.js';
export { CHUNK_NUMBERS } from './pack/chunks.js';
export { isOfPlanes, sampleAxis } from './pack/morton.js';
export { packedOrder } from './pack/pack.js';
export { recentred } from './pack/recentre.js';
export { choosePrecision, noiseIn, SCALE_BIAS, SCALE_STEPS, type ShPrecision } from './pack/sh.js';
export { shReader } from './pack/unpack.js';
export { decodePage } from './streaming/decode-page.js';
export { pageLayout, type DetailManifest } from './streaming/manifest.js';
export * from './streaming/page-coding.js';
export {
  CENTER_ROUNDING,
  directionIn2,
  directionIn3,
  packQuantizedChunk,
  QUANTIZED_CHUNK_WORDS,
  readRow,
  ROW_CODES,
  rowLengths,
  widenReach,
} from './streaming/quantized-geometry.js';
