import { perDevice } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import type { Threads } from './stages/stage.js';

/** Settings that autotuning selects for a device. All combinations draw the same image, at different speeds. */
export interface Variants {
  readonly rasterizer: RasterizerName;
  readonly accumulation: AccumulationFormat;
  readonly threads: Threads;
}

/** Variants that work everywhere. */
export const FALLBACK: Variants = {
  rasterizer: 'quads',
  accumulation: 'rgba16float',
  threads: 'parallel',
};
/** Variants that most GPUs prefer. */
export const PREFERRED: Variants = { rasterizer: 'tiles', accumulation: 'rgba16float', threads: 'parallel' };

/** Returns the variants of a device, which `autotune` sets. */
const known = (device: GPUDevice): { variants: Variants } =>
  perDevice(device, 'variants', () => ({ variants: FALLBACK }));

export function setVariants(device: GPUDevice, variants: Variants): void {
  known(device).variants = variants;
}

/** Returns the current variants of a device. */
export const variantsOf = (device: GPUDevice): Variants => known(device).variants;

/**
 * Messages about failed self-tests of a device's variants, which are then not used. The list is empty for a WebGL
 * context.
 */
export const faultsOf = (device: object): string[] => perDevice(device, 'faults', () => []);

/**
 * Replaces every `auto` of the settings by the variant of the device. For `order: 'pixel'` the rasterizer becomes
 * `tiles`.
 */
export function resolveSettings(variants: Variants, settings: RenderSettings): RenderSettings & Variants {
  const own = settings.order === 'pixel' ? 'tiles' : variants.rasterizer;
  const rasterizer = settings.rasterizer === 'auto' ? own : settings.rasterizer;
  const suits = rasterizer === variants.rasterizer ? variants.accumulation : FALLBACK.accumulation;
  return {
    ...settings,
    rasterizer,
    accumulation: settings.accumulation === 'auto' ? suits : settings.accumulation,
    threads: settings.threads === 'auto' ? variants.threads : settings.threads,
  };
}
