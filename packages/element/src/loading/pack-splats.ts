/** Packs arrays of a page for WebGL, which has no shader that does. */
import { boundsOf, keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { packCloud } from './pack-cloud.js';
import type { LoadedScene } from './protocol.js';
import type { SplatState } from '../sources/splats/splat-input.js';

const SH_C0 = 0.28209479177387814;

/** Packs the splats of a state. The arrays are copies of those of the page, and are overwritten. */
export async function packSplats({ count, arrays, shDegree, raw, rule, origin, up }: SplatState): Promise<LoadedScene> {
  const { positions, scales, rotations, opacities, sh, colors } = arrays as Required<SplatState['arrays']>;
  if (raw)
    for (let i = 0; i < count; i++) {
      for (let k = 3 * i; k < 3 * i + 3; k++) scales[k] = Math.exp(scales[k]);
      opacities[i] = 1 / (1 + Math.exp(-opacities[i]));
    }
  const harmonics = sh ?? colors.map((color) => (color - 0.5) / SH_C0);
  const given = { ...rule, count, origin, positions, scales, rotations, opacities, shDegree, sh: harmonics };
  const cloud: GaussianCloud = keepUsable({ ...given, droppedCount: 0 });
  return { packed: await packCloud(cloud), bounds: { ...boundsOf(cloud), up } };
}
