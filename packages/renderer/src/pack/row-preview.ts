import { constants } from '../generated/shaders.js';
import type { PackedGaussians } from './pack.js';
import type { RowPacker } from './row-packer.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS } from './words.js';

const { CULL_GROUP } = constants;

/**
 * Returns every n-th of the splats that were packed as `int8`, without view-dependent color, enlarged to represent the
 * rest; n is a power of 4.
 * @param maxSplats Maximum number of splats of the preview.
 */
export function previewOf(
  packer: RowPacker,
  maxSplats: number,
): Pick<PackedGaussians, 'count' | 'geometry' | 'sh' | 'chunks'> {
  let [step, octaves] = [1, 0];
  while (packer.count / step > maxSplats) [step, octaves] = [4 * step, octaves + 1];
  const count = Math.ceil(packer.count / step);
  const geometry = new Uint32Array(GEOMETRY_WORDS * count);
  const floats = new Float32Array(geometry.buffer);
  const sh = new Uint32Array(2 * count);
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(count / CULL_GROUP));
  const { words, stride, reaches } = packer.packed;
  const rowOf = packer.rowReader();
  for (let k = 0; k < count; k++) {
    const row = rowOf(step * k);
    const from = stride * row;
    const to = GEOMETRY_WORDS * k;
    for (let w = 0; w < GEOMETRY_WORDS; w++) {
      let word = words[from + w];
      // Adds to the exponents of the entries of the factor; see `packShape`.
      if (w > 2 && word >>> 10 !== 0) word += octaves << 23;
      if (w === 3 && word & 0x3ff) word += octaves << 1;
      geometry[to + w] = word;
    }
    sh[2 * k] = words[from + GEOMETRY_WORDS];
    sh[2 * k + 1] = words[from + GEOMETRY_WORDS + 1] & 0xffff;
    const chunk = CHUNK_NUMBERS * Math.floor(k / CULL_GROUP);
    for (let axis = 0; axis < 3; axis++) {
      const x = floats[to + axis];
      const isFirst = k % CULL_GROUP === 0;
      if (isFirst || x < chunks[chunk + axis]) chunks[chunk + axis] = x;
      if (isFirst || x > chunks[chunk + 4 + axis]) chunks[chunk + 4 + axis] = x;
    }
    chunks[chunk + 3] = Math.max(chunks[chunk + 3], 2 ** octaves * reaches[row]);
  }
  return { count, geometry, sh, chunks };
}
