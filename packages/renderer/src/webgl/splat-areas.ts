import { unpackSplat } from '../pack/unpack.js';
import { GEOMETRY_WORDS } from '../pack/words.js';

/** Splats unpacked at a time. */
const BLOCK = 1024;

/**
 * [N] areas of the squares around the largest cross sections of packed splats, as far out as they are visible, in
 * squared units of their positions.
 */
export function areasIn(geometry: Uint32Array): Float32Array {
  const count = geometry.length / GEOMETRY_WORDS;
  const areas = new Float32Array(count);
  const [positions, factors, opacities] = [3, 6, 1].map((size) => new Float32Array(size * BLOCK));
  for (let first = 0; first < count; first += BLOCK) {
    const rows = Math.min(BLOCK, count - first);
    const block = geometry.subarray(GEOMETRY_WORDS * first, GEOMETRY_WORDS * (first + rows));
    for (let i = 0; i < rows; i++) {
      unpackSplat(block, i, positions, factors, opacities);
      areas[first + i] = areaOf(factors, 6 * i, opacities[i]);
    }
  }
  return areas;
}

/** The product of the two longest axes is the largest minor of the factor, up to a factor of √3. */
function areaOf(factors: Float32Array, at: number, opacity: number): number {
  const [xx, yx, yy] = [factors[at], factors[at + 1], factors[at + 2]];
  const [zx, zy, zz] = [factors[at + 3], factors[at + 4], factors[at + 5]];
  const corner = yx * zy - yy * zx;
  const squares = (xx * yy) ** 2 + (xx * zy) ** 2 + corner ** 2 + (xx * zz) ** 2 + (yx * zz) ** 2 + (yy * zz) ** 2;
  return 8 * Math.log(Math.max(1, 255 * opacity)) * Math.sqrt(squares);
}
