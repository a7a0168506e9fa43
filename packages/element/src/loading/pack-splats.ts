/** Packs arrays of a page for WebGL, which has no shader that does. */
import { boundsOf, isUsable, keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { packedOrder, recentered } from '@gaussian-splat/renderer/tools';
import { packCloud } from './pack-cloud.js';
import type { LoadedScene } from './protocol.js';
import type { SplatState } from '../sources/splats/splat-input.js';

const SH_C0 = 0.28209479177387814;

/** A packed scene, with the index in the arrays of each splat. */
export interface PackedSplats extends LoadedScene {
  readonly rows: Uint32Array;
}

/** Packs the splats of a state. The arrays are copies of those of the page, and are overwritten. */
export async function packSplats({
  count,
  arrays,
  shDegree,
  raw,
  rule,
  origin,
  up,
}: SplatState): Promise<PackedSplats> {
  const { positions, scales, rotations, opacities, sh, colors } = arrays as Required<SplatState['arrays']>;
  if (raw)
    for (let i = 0; i < count; i++) {
      for (let k = 3 * i; k < 3 * i + 3; k++) scales[k] = Math.exp(scales[k]);
      opacities[i] = 1 / (1 + Math.exp(-opacities[i]));
    }
  const harmonics = sh ?? colors.map((color) => (color - 0.5) / SH_C0);
  const given = { ...rule, count, origin, positions, scales, rotations, opacities, shDegree, sh: harmonics };
  const whole: GaussianCloud = { ...given, droppedCount: 0 };
  const kept = Uint32Array.from({ length: count }, (_, i) => i).filter((i) => isUsable(whole, i));
  const cloud = keepUsable(whole);
  const rows = packedOrder(recentered(cloud)).map((i) => kept[i]);
  return { packed: await packCloud(cloud), bounds: { ...boundsOf(cloud), up }, rows };
}
