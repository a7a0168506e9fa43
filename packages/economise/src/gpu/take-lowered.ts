import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { BUFFER_USAGE, GpuMemory, rareKernelOf, writeStruct } from '@gaussian-splat/renderer/stages';
import { economiseTake, SCORE_GROUP } from '../generated/shaders.js';
import { layouts } from './layouts.js';
import { readBack } from './read-back.js';
import type { ScenePart } from './scene-parts.js';

/** Splats of a part that keep the same degree, and their coefficients. */
export interface LoweredSplats {
  readonly part: ScenePart;
  readonly degree: ShDegree;
  /** Numbers of the splats within the part. */
  readonly splats: Uint32Array;
}

/** [splats, (degree + 1)², 3] the coefficients that were found for them, for each of several lists. No more comes back than that. */
export async function takeLowered(
  device: GPUDevice,
  shDegree: ShDegree,
  lists: readonly LoweredSplats[],
): Promise<Float32Array[]> {
  const memory = new GpuMemory(device);
  try {
    const taken = lists.map((list) => take(device, memory, shDegree, list));
    return (await readBack(device, taken)).map((bytes) => new Float32Array(bytes));
  } finally {
    memory.destroy();
  }
}

function take(
  device: GPUDevice,
  memory: GpuMemory,
  sh_degree: ShDegree,
  { part, degree, splats }: LoweredSplats,
): { buffer: GPUBuffer; byteLength: number } {
  const { uniform, storage, copySource } = BUFFER_USAGE;
  const width = 3 * shCoefficientCount(degree);
  const count = width * splats.length;
  const counts = new ArrayBuffer(layouts.Take.size);
  writeStruct(layouts.Take, { count, width, sh_degree, degree }, counts);
  const taken = memory.buffer('gs.economise.taken', 4 * count, storage | copySource);
  const kernel = rareKernelOf(device, economiseTake);
  const bindings = kernel.bind({
    take: memory.buffer('gs.economise.take', counts.byteLength, uniform, new Uint32Array(counts)),
    splats: memory.buffer('gs.economise.splats', splats.byteLength, storage, splats),
    ...{ lowered: part.lowered, taken },
  });
  const encoder = device.createCommandEncoder({ label: 'gs.economise.take' });
  const pass = encoder.beginComputePass({ label: 'gs.economise.take' });
  kernel.dispatch(pass, bindings, Math.ceil(count / SCORE_GROUP));
  pass.end();
  device.queue.submit([encoder.finish()]);
  return { buffer: taken, byteLength: 4 * count };
}
