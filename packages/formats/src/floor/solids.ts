import type { ExtinctionGrid } from './extinction.js';

/**
 * Minimum opacity of a solid voxel, 0..1, measured on indoor scenes with known floors. Lower values close doors, and
 * higher ones leave holes in walls.
 */
const SOLID_OPACITY = 0.4;
/** Minimum number of voxels of a connected component, in a neighborhood of 26. Smaller components are floaters. */
const MIN_PIECE = 64;

/**
 * Returns which voxels of a grid block a body, [nz, ny, nx]: 1 for solid, 0 for empty. Components of fewer than 64
 * connected voxels are considered empty.
 */
export function solidsOf({ values, size: [nx, ny, nz] }: ExtinctionGrid): Uint8Array {
  const limit = -Math.log(1 - SOLID_OPACITY);
  const solid = new Uint8Array(values.length);
  for (let at = 0; at < values.length; at++) if (values[at] >= limit) solid[at] = 1;
  const seen = new Uint8Array(solid.length);
  const stack: number[] = [];
  const piece: number[] = [];
  for (let start = 0; start < solid.length; start++) {
    if (solid[start] === 0 || seen[start] === 1) continue;
    stack.push(start);
    seen[start] = 1;
    piece.length = 0;
    while (stack.length > 0) {
      const at = stack.pop()!;
      if (piece.length < MIN_PIECE) piece.push(at);
      const x = at % nx;
      const y = Math.floor(at / nx) % ny;
      const z = Math.floor(at / (nx * ny));
      for (let k = Math.max(0, z - 1); k <= Math.min(nz - 1, z + 1); k++)
        for (let j = Math.max(0, y - 1); j <= Math.min(ny - 1, y + 1); j++)
          for (let i = Math.max(0, x - 1); i <= Math.min(nx - 1, x + 1); i++) {
            const next = i + nx * (j + ny * k);
            if (solid[next] === 0 || seen[next] === 1) continue;
            seen[next] = 1;
            stack.push(next);
          }
    }
    if (piece.length < MIN_PIECE) for (const at of piece) solid[at] = 0;
  }
  return solid;
}
