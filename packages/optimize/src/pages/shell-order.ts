import { constants, isOfPlanes, sampleAxis } from '@gaussian-splat/renderer/tools';

const { CULL_GROUP } = constants;
/**
 * Extent of the first shell in median distances from the median along each axis. Each further shell extends twice as far
 * as the previous one.
 */
const FIRST_REACH = 8;
const MAX_SHELLS = 256;

/** An order of splats with padding splats between chunks. */
export interface ShellOrder {
  /** Indices of splats. At {@link fillers}, an index is repeated. */
  readonly order: Uint32Array;
  /** Indices in `order` of padding splats, which need opacity 0. They end a chunk, so that the next splat begins one. */
  readonly fillers: readonly number[];
}

/**
 * Returns an order whose chunks have only splats of two adjacent shells around the center of the scene. Coordinates
 * relative to a chunk are then precise for near splats, too. The order within a shell does not change. A scene of planes
 * keeps its order.
 * @param positions [N, 3] positions in units of the scene.
 * @param kept Indices of splats with neighbors adjacent; not modified.
 */
export function shellOrder(positions: Float32Array, kept: Uint32Array): ShellOrder {
  if (kept.length === 0 || isOfPlanes(positions, kept)) return { order: kept, fillers: [] };
  const { shells, counts } = shellsOf(positions, kept);
  const isOne = counts[0] === kept.length;
  return isOne ? { order: kept, fillers: [] } : filledUp(kept, shells, counts);
}

/** Returns the shell of each splat, and the number of splats in each shell. */
function shellsOf(positions: Float32Array, kept: Uint32Array): { shells: Uint8Array; counts: Uint32Array } {
  const axes = [0, 1, 2].map((axis) => sampleAxis(positions, kept, axis));
  const shells = new Uint8Array(kept.length);
  const counts = new Uint32Array(MAX_SHELLS);
  for (let k = 0; k < kept.length; k++) {
    let farthest = 0;
    for (let axis = 0; axis < 3; axis++) {
      const { median, spread } = axes[axis];
      farthest = Math.max(farthest, Math.abs(positions[3 * kept[k] + axis] - median) / spread);
    }
    const shell = farthest > FIRST_REACH ? Math.ceil(Math.log2(farthest / FIRST_REACH)) : 0;
    counts[(shells[k] = Math.min(MAX_SHELLS - 1, shell))]++;
  }
  return { shells, counts };
}

/**
 * Concatenates shells. If a shell would begin in a chunk with a shell that is not adjacent to it, the chunk is padded
 * first.
 */
function filledUp(kept: Uint32Array, shells: Uint8Array, counts: Uint32Array): ShellOrder {
  const starts = new Uint32Array(MAX_SHELLS);
  const fillers: number[] = [];
  // `open` is the index of the chunk that is being filled, and `innermost` its first shell.
  let [end, open, innermost] = [0, 0, 0];
  counts.forEach((count, shell) => {
    if (count === 0) return;
    if (end % CULL_GROUP === 0) innermost = shell;
    else if (shell > innermost + 1) for (innermost = shell; end % CULL_GROUP > 0; end++) fillers.push(end);
    starts[shell] = end;
    end += count;
    const begun = Math.floor(end / CULL_GROUP);
    if (begun > open) [open, innermost] = [begun, shell];
  });
  const order = new Uint32Array(end);
  shells.forEach((shell, k) => (order[starts[shell]++] = kept[k]));
  for (const place of fillers) order[place] = order[place - 1];
  return { order, fillers };
}
