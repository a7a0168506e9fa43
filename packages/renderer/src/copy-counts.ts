import { layouts } from './generated/shaders.js';

/** Copies `visible` and `overflow` of the splats, and of the pairs if there are any, four words, into a buffer. */
export function copyCounts(
  encoder: GPUCommandEncoder,
  plan: GPUBuffer,
  pairPlan: GPUBuffer | undefined,
  target: GPUBuffer,
  offset: number,
): void {
  const { visible, overflow } = layouts.Plan.fields;
  if (overflow.offset !== visible.offset + 4) throw new Error('Plan: overflow must follow visible');
  encoder.copyBufferToBuffer(plan, visible.offset, target, offset, 8);
  if (pairPlan) encoder.copyBufferToBuffer(pairPlan, visible.offset, target, offset + 8, 8);
}
