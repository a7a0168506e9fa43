import { perDevice } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import type { Threads } from './stages/stage.js';

/** Settings that autotuning selects for a device: all of them draw the same image, at different speeds. */
export interface Variants {
  readonly rasterizer: RasterizerName;
  readonly accumulation: AccumulationFormat;
  readonly threads: Threads;
}

/** Variants that work everywhere. */
export const SAFE: Variants = {
  rasterizer: 'quads',
  accumulation: 'rgba16float',
  threads: 'parallel',
};
/** Variants that most GPUs prefer. */
export const LIKELY: Variants = { rasterizer: 'tiles', accumulation: 'rgba16float', threads: 'parallel' };

/** Variants of a device, set by `autotune`. */
const known = (device: GPUDevice): { variants: Variants } => perDevice(device, 'variants', () => ({ variants: SAFE }));

export function remember(device: GPUDevice, variants: Variants): void {
  known(device).variants = variants;
}

/** The current variants of a device. */
export const variantsOf = (device: GPUDevice): Variants => known(device).variants;

/** Messages about failed self-tests of a device's variants, which are then not used; empty for a WebGL context. */
export const faultsOf = (device: object): string[] => perDevice(device, 'faults', () => []);

/** Replaces every `auto` of the settings by the device's variant. */
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
