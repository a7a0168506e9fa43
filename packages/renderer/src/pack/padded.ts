import { constants } from '../generated/shaders.js';
import type { PackedGaussians } from './pack.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from './words.js';

/** Returns a packed scene with room for `count` splats, a multiple of 256. The added words are 0: splats of opacity 0. */
export function padded(scene: PackedGaussians, count: number): PackedGaussians {
  const geometry = new Uint32Array(GEOMETRY_WORDS * count);
  const sh = new Uint32Array(shWords(scene.shDegree, scene.shPrecision) * count);
  const chunks = new Float32Array((CHUNK_NUMBERS * count) / constants.CULL_GROUP);
  geometry.set(scene.geometry);
  sh.set(scene.sh);
  chunks.set(scene.chunks);
  return { ...scene, count, geometry, sh, chunks };
}
