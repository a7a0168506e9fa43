import type { GaussianCloud } from '@gaussian-splat/core';
import { packGaussians, type PackedGaussians, type PackOptions } from '../pack/pack.js';
import { finish } from './build-levels.js';
import { buildPackedLevels, joinLevels } from './packed-levels.js';

/**
 * Packs a cloud with all its levels of detail: the splats of {@link packGaussians}, in the same places, and behind them a third as many that stand
 * for four, sixteen and more of them. The settings `detail` and `splatBudget` choose among them; with neither the image is the same.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function packWithDetail(given: GaussianCloud, options: PackOptions = {}): PackedGaussians {
  const packed = packGaussians(given, options);
  const levels = finish(buildPackedLevels(packed));
  return levels === undefined ? packed : joinLevels(packed, levels);
}
