import { constants, type Curve } from '@gaussian-splat/renderer/tools';

const { CULL_GROUP } = constants;
/**
 * Extent of the first shell in median distances from the median along each axis. Each further shell extends twice as far
 * as the previous one.
 */
const FIRST_REACH = 8;
export const MAX_SHELLS = 256;

/** Number of splats in each shell, [MAX_SHELLS]. */
export type ShellCounts = Float64Array;

/** Places of shells in the order of a scene. */
export interface ShellPlaces {
  /** Index of the first splat of each shell. */
  readonly starts: Float64Array;
  /** Number of splats with padding splats. */
  readonly end: number;
  /**
   * Ranges of padding splats, which repeat the splat before them with opacity 0. They end a chunk, so that the next splat
   * begins one.
   */
  readonly fillers: readonly { readonly first: number; readonly end: number }[];
}

/**
 * Returns the shell of each splat around the center of the scene. Coordinates relative to a chunk whose splats are in at
 * most two adjacent shells are precise for near splats, too.
 * @param axes Median and spread of the scene on each axis.
 * @param positions [N, 3] positions in units of the scene.
 */
export function shellsAround(axes: Curve, positions: Float32Array): Uint8Array {
  const shells = new Uint8Array(positions.length / 3);
  for (let k = 0; k < shells.length; k++) {
    let farthest = 0;
    for (let axis = 0; axis < 3; axis++) {
      const { median, spread } = axes[axis];
      farthest = Math.max(farthest, Math.abs(positions[3 * k + axis] - median) / spread);
    }
    const shell = farthest > FIRST_REACH ? Math.ceil(Math.log2(farthest / FIRST_REACH)) : 0;
    shells[k] = Math.min(MAX_SHELLS - 1, shell);
  }
  return shells;
}

/**
 * Concatenates shells. If a shell would begin in a chunk with a shell that is not adjacent to it, the chunk is padded
 * first.
 */
export function placeShells(counts: ShellCounts): ShellPlaces {
  const starts = new Float64Array(MAX_SHELLS);
  const fillers: { first: number; end: number }[] = [];
  // `open` is the index of the chunk that is being filled, and `innermost` its first shell.
  let [end, open, innermost] = [0, 0, 0];
  counts.forEach((count, shell) => {
    if (count === 0) return;
    if (end % CULL_GROUP === 0) innermost = shell;
    else if (shell > innermost + 1) {
      const first = end;
      innermost = shell;
      end = CULL_GROUP * Math.ceil(end / CULL_GROUP);
      fillers.push({ first, end });
    }
    starts[shell] = end;
    end += count;
    const begun = Math.floor(end / CULL_GROUP);
    if (begun > open) [open, innermost] = [begun, shell];
  });
  return { starts, end, fillers };
}
