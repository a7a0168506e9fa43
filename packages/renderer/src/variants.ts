import { perDevice } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import type { Threads } from './stages/stage.js';

/** What a renderer leaves to the device: all of them draw the same image, at different speeds. */
export interface Variants {
  readonly rasterizer: RasterizerName;
  readonly accumulation: AccumulationFormat;
  readonly threads: Threads;
}

/** What works everywhere. */
export const SAFE: Variants = {
  rasterizer: 'quads',
  accumulation: 'rgba16float',
  threads: 'parallel',
};
/** What is likely to suit a GPU. */
export const LIKELY: Variants = { rasterizer: 'tiles', accumulation: 'rgba16float', threads: 'parallel' };

/** Variants known to suit a device, set by `autotune`. */
const known = (device: GPUDevice): { variants: Variants } => perDevice(device, 'variants', () => ({ variants: SAFE }));

export function remember(device: GPUDevice, variants: Variants): void {
  known(device).variants = variants;
}

/** What is known to suit a device by now. */
export const variantsOf = (device: GPUDevice): Variants => known(device).variants;

/** Sentences on what the self-test found wrong on a device, whose variants are not used; empty for a WebGL context. */
export const faultsOf = (device: object): string[] => perDevice(device, 'faults', () => []);

/** Settings with every `auto` replaced by what suits the device. */
export function settle(variants: Variants, levers: RenderSettings): RenderSettings & Variants {
  const own = levers.order === 'pixel' ? 'tiles' : variants.rasterizer;
  const rasterizer = levers.rasterizer === 'auto' ? own : levers.rasterizer;
  const suits = rasterizer === variants.rasterizer ? variants.accumulation : SAFE.accumulation;
  return {
    ...levers,
    rasterizer,
    accumulation: levers.accumulation === 'auto' ? suits : levers.accumulation,
    threads: levers.threads === 'auto' ? variants.threads : levers.threads,
  };
}
