import { constants } from '../generated/shaders.js';
import type { PackedGaussians } from '../pack/pack.js';
import { shReader, unpackSplat } from '../pack/unpack.js';
import { FACTOR_NUMBERS, type LevelSource } from './splat-level.js';

/** The splats of a packed scene as the finest level: what made it, file or generator, need not be there any more. */
export function packedLeaves(packed: PackedGaussians): LevelSource {
  const { count, geometry, shDegree, antialiased, filterVariance = constants.DILATION } = packed;
  const positions = new Float32Array(3 * count);
  const factors = new Float32Array(FACTOR_NUMBERS * count);
  const opacities = new Float32Array(count);
  for (let i = 0; i < count; i++) unpackSplat(geometry, i, positions, factors, opacities);
  const dilation = antialiased ? 0 : filterVariance;
  const spreads = new Float32Array(count);
  return { count, positions, factors, opacities, spreads, shDegree, dilation, readSh: shReader(packed) };
}
