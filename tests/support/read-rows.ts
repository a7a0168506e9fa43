import type { StreamedGaussians } from '@gaussian-splat/renderer';
import { DETAIL_NUMBERS, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { anyDevice } from './node-device.js';

/** Detail rows of each slot of a streamed scene, as they are on the GPU. */
export async function readRows(scene: StreamedGaussians): Promise<Float32Array[]> {
  const device = await anyDevice();
  const rows: Float32Array[] = [];
  for (const { details } of scene.pages) {
    const staging = device.createBuffer({ size: details!.size, usage: 0x1 | 0x8 });
    const encoder = device.createCommandEncoder();
    encoder.copyBufferToBuffer(details!, 0, staging, 0, details!.size);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    const all = new Float32Array(staging.getMappedRange().slice(0));
    staging.destroy();
    const stride = DETAIL_NUMBERS * SLOT_CHUNKS;
    for (let at = 0; at + stride <= all.length; at += stride) rows.push(all.subarray(at, at + stride));
  }
  return rows;
}
