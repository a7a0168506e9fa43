import { constants, isOfPlanes, sampleAxis } from '@gaussian-splat/renderer/tools';

const { CULL_GROUP } = constants;
/** Splats within so many median distances from the median, along each axis, are one shell; every other shell reaches twice as far as the one before. */
const FIRST_REACH = 8;
const MOST_SHELLS = 256;

/** An order of splats in chunks, and which places of it are filled up. */
export interface ShellOrder {
  /** Indices of splats; those of {@link fillers} name one that is there already. */
  readonly order: Uint32Array;
  /** Places that splats of opacity 0 take, so that the next one begins a chunk. */
  readonly fillers: readonly number[];
}

/**
 * Splats far off have chunks of their own, so that coordinates relative to a chunk are as fine as those near by need: no chunk holds splats of other than two neighbouring shells around the middle of
 * the scene. Within a shell the order stays. A scene of planes keeps all of it.
 * @param positions [3 N] world units
 * @param kept indices of splats, neighbours side by side; not changed
 */
export function shellOrder(positions: Float32Array, kept: Uint32Array): ShellOrder {
  if (kept.length === 0 || isOfPlanes(positions, kept)) return { order: kept, fillers: [] };
  const { shells, counts } = shellsOf(positions, kept);
  const isOne = counts[0] === kept.length;
  return isOne ? { order: kept, fillers: [] } : filledUp(kept, shells, counts);
}

/** The shell of each splat, and how many each has. */
function shellsOf(positions: Float32Array, kept: Uint32Array): { shells: Uint8Array; counts: Uint32Array } {
  const axes = [0, 1, 2].map((axis) => sampleAxis(positions, kept, axis));
  const shells = new Uint8Array(kept.length);
  const counts = new Uint32Array(MOST_SHELLS);
  for (let k = 0; k < kept.length; k++) {
    let farthest = 0;
    for (let axis = 0; axis < 3; axis++) {
      const { median, spread } = axes[axis];
      farthest = Math.max(farthest, Math.abs(positions[3 * kept[k] + axis] - median) / spread);
    }
    const shell = farthest > FIRST_REACH ? Math.ceil(Math.log2(farthest / FIRST_REACH)) : 0;
    counts[(shells[k] = Math.min(MOST_SHELLS - 1, shell))]++;
  }
  return { shells, counts };
}

/** Shell after shell; where one begins within a chunk of another than the one before, that chunk is filled up first. */
function filledUp(kept: Uint32Array, shells: Uint8Array, counts: Uint32Array): ShellOrder {
  const starts = new Uint32Array(MOST_SHELLS);
  const fillers: number[] = [];
  // The innermost shell of the chunk that is open.
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
