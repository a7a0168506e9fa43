import { requireBlendable } from '../requirements.js';
import type { Variants } from '../variants.js';
import { QuadsRasterizer } from './quads.js';
import type { Rasterizer } from './rasterizer.js';
import { TilesRasterizer } from './tiles.js';

/** @throws GaussianSplatError `unsupported/limits` if the variant needs a feature that the device lacks. */
export function makeRasterizer(device: GPUDevice, { rasterizer, accumulation, threads }: Variants): Rasterizer {
  if (rasterizer === 'tiles') return new TilesRasterizer(device, accumulation, threads);
  requireBlendable(device, accumulation);
  return new QuadsRasterizer(device, accumulation);
}
