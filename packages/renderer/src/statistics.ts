import { layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';

/** Counts of one frame. */
export interface FrameStatistics {
  /** Splats drawn: in front of the camera, opaque enough, and over at least one pixel. */
  readonly visible: number;
  /** Visible splats that found no room in the renderer's buffers and were left out. */
  readonly overflow: number;
  /** Splats on the GPU that were refused because a value was not usable. */
  readonly unusable: number;
}

/** Reads the counts out of a `Plan` buffer. */
export async function readStatistics(device: GPUDevice, plan: GPUBuffer): Promise<FrameStatistics> {
  const { size, fields } = layouts.Plan;
  const staging = device.createBuffer({
    label: 'gs.statistics',
    size,
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(plan, 0, staging, 0, size);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const words = new Uint32Array(staging.getMappedRange().slice(0));
  staging.destroy();
  const read = (name: 'visible' | 'overflow' | 'unusable'): number => words[fields[name].offset / 4];
  return { visible: read('visible'), overflow: read('overflow'), unusable: read('unusable') };
}
