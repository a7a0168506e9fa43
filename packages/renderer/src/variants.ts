import { GaussianSplatError } from '@gaussian-splat/core';
import { perDevice } from './gpu/kernel.js';
import type { Levers } from './levers.js';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import { canSort, type SortName } from './stages/sort.js';
import type { Threads } from './stages/threads.js';

/** What a renderer leaves to the device: all of them draw the same image, at different speeds. */
export interface Variants {
  readonly rasterizer: RasterizerName;
  readonly accumulation: AccumulationFormat;
  readonly threads: Threads;
  readonly sort: SortName;
}

/** What works everywhere. */
export const SAFE: Variants = {
  rasterizer: 'quads',
  accumulation: 'rgba16float',
  threads: 'parallel',
  sort: 'shared8',
};

/** Variants known to suit a device, set by `chooseVariants`. */
const known = (device: GPUDevice): { variants: Variants } => perDevice(device, 'variants', () => ({ variants: SAFE }));

export function remember(device: GPUDevice, variants: Variants): void {
  known(device).variants = variants;
}

/** Levers with every `auto` replaced by what suits the device. */
export function settle(device: GPUDevice, levers: Levers): Levers & Variants {
  const { variants } = known(device);
  const rasterizer = levers.rasterizer === 'auto' ? variants.rasterizer : levers.rasterizer;
  const suits = rasterizer === variants.rasterizer ? variants.accumulation : SAFE.accumulation;
  const threads = levers.threads === 'auto' ? variants.threads : levers.threads;
  return {
    ...levers,
    rasterizer,
    accumulation: levers.accumulation === 'auto' ? suits : levers.accumulation,
    threads,
    sort: levers.sort === 'auto' ? sortFor(threads, variants) : requireSort(device, levers.sort),
  };
}

/** Asked for other threads than those that suit the device, a renderer sorts as those do. */
function sortFor(threads: Threads, variants: Variants): SortName {
  if (threads === variants.threads) return variants.sort;
  return threads === 'serial' ? 'serial' : SAFE.sort;
}

function requireSort(device: GPUDevice, name: SortName): SortName {
  if (canSort(device, name)) return name;
  throw new GaussianSplatError('unsupported/limits', {
    where: 'RendererOptions.sort',
    expected: 'a device with the feature subgroups, and subgroups large enough',
    found: `a device ${device.features.has('subgroups') ? 'whose subgroups are too small' : 'without the feature'}`,
    remedy: 'ask for the feature with deviceDescriptor(adapter), or use shared8',
  });
}
