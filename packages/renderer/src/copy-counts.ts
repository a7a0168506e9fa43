import { layouts } from './generated/shaders.js';

/** A u32 in a buffer; the offset is in bytes. */
export interface CountPlace {
  readonly buffer: GPUBuffer;
  readonly offset: number;
}

/**
 * Copies four u32 into a buffer: `visible` and `overflow` of the splats, then of the pairs. Without a plan of pairs
 * only the first two are copied.
 */
export function copyCounts(
  encoder: GPUCommandEncoder,
  plan: GPUBuffer,
  pairPlan: GPUBuffer | undefined,
  target: GPUBuffer,
  offset: number,
): void {
  // `overflow` follows `visible`, which a test of the layouts checks.
  const { visible } = layouts.Plan.fields;
  encoder.copyBufferToBuffer(plan, visible.offset, target, offset, 8);
  if (pairPlan) encoder.copyBufferToBuffer(pairPlan, visible.offset, target, offset + 8, 8);
}
