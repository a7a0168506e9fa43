import { turn } from '../gpu/page-thread.js';
import { unpackSplat } from '../pack/unpack.js';
import { GEOMETRY_WORDS } from '../pack/words.js';

/** Number of splats that are unpacked in one step. */
const BLOCK = 1024;
/** Milliseconds after which the function yields to other tasks of the page. */
const SLICE_MS = 8;

/**
 * Resolves to [N] areas of packed splats: of the square around the largest cross section of each, as far out as it is
 * visible. In squared units of the positions. Yields to other tasks of the page.
 */
export async function areasIn(geometry: Uint32Array): Promise<Float32Array> {
  const count = geometry.length / GEOMETRY_WORDS;
  const areas = new Float32Array(count);
  const [positions, factors, opacities] = [3, 6, 1].map((size) => new Float32Array(size * BLOCK));
  let end = performance.now() + SLICE_MS;
  for (let first = 0; first < count; first += BLOCK) {
    if (performance.now() > end) {
      await turn();
      end = performance.now() + SLICE_MS;
    }
    const rows = Math.min(BLOCK, count - first);
    const block = geometry.subarray(GEOMETRY_WORDS * first, GEOMETRY_WORDS * (first + rows));
    for (let i = 0; i < rows; i++) {
      unpackSplat(block, i, positions, factors, opacities);
      areas[first + i] = areaOf(factors, 6 * i, opacities[i]);
    }
  }
  return areas;
}

/**
 * Returns the area of a splat. The product of its two longest axes is estimated from the minors of the factor, to
 * within a factor of √3.
 */
function areaOf(factors: Float32Array, at: number, opacity: number): number {
  const [xx, yx, yy] = [factors[at], factors[at + 1], factors[at + 2]];
  const [zx, zy, zz] = [factors[at + 3], factors[at + 4], factors[at + 5]];
  const corner = yx * zy - yy * zx;
  const squares = (xx * yy) ** 2 + (xx * zy) ** 2 + corner ** 2 + (xx * zz) ** 2 + (yx * zz) ** 2 + (yy * zz) ** 2;
  return 8 * Math.log(Math.max(1, 255 * opacity)) * Math.sqrt(squares);
}
