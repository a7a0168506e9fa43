import { makeStages, type Stages } from './bindings.js';
import type { Overrides } from './gpu/kernel.js';
import { overridesOf, type Levers } from './levers.js';
import type { OrderKind } from './rasterizers/rasterizer.js';
import { sortedIn } from './stages/sort.js';
import type { Variants } from './variants.js';

/** Levers in force for a frame, and as the stages want them. */
export interface FrameMix {
  readonly levers: Levers & Variants;
  readonly overrides: Overrides;
  /** Those of other levers fit the same bind groups. */
  readonly stages: Stages;
}

export function mixOf(device: GPUDevice, levers: Levers & Variants): FrameMix {
  const overrides = overridesOf(levers);
  return { levers, overrides, stages: makeStages(device, overrides, levers) };
}

/** Where a sort by the levers' keys leaves its result. */
export const sortedOrder = ({ sort, depthKeyBits }: Levers & Variants): OrderKind =>
  sortedIn(sort, depthKeyBits) === 0 ? 'first' : 'second';
