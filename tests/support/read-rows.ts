import type { StreamedGaussians } from '@gaussian-splat/renderer';
import { DETAIL_NUMBERS, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { anyDevice } from './node-device.js';

/** Reads the contents of a buffer. */
export async function readBuffer(buffer: GPUBuffer): Promise<ArrayBuffer> {
  const device = await anyDevice();
  const staging = device.createBuffer({ size: buffer.size, usage: 0x1 | 0x8 });
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(buffer, 0, staging, 0, buffer.size);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const bytes = staging.getMappedRange().slice(0);
  staging.destroy();
  return bytes;
}

/** Detail rows of each slot of a streamed scene, as they are on the GPU. */
export async function readRows(scene: StreamedGaussians): Promise<Float32Array[]> {
  const rows: Float32Array[] = [];
  for (const { details } of scene.blocks) {
    const all = new Float32Array(await readBuffer(details!));
    const stride = DETAIL_NUMBERS * SLOT_CHUNKS;
    for (let at = 0; at + stride <= all.length; at += stride) rows.push(all.subarray(at, at + stride));
  }
  return rows;
}
