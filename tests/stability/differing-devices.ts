/**
 * S26. Devices that differ.
 *
 * Who fails: no renderer was named; float16 centers (web-splat, Visionary, WebSplatter) and atomically appended splats make images differ between devices and runs.
 *
 * Recipe: asked for two adapters. Run with two devices of one, and against the image of SwiftShader that is kept: with another adapter the same command
 * compares the two.
 *
 * Passes: two devices of one adapter agree to the byte; the image of any adapter agrees with the one that SwiftShader has drawn, which is kept here, to 1/255 in 99.9 % of
 * all channels. With GAUSSIAN_SPLAT_GPU=system the row draws with the driver of the machine (llvmpipe, say).
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { offCenter } from '../support/scenes.js';
import { percentile } from '../support/metrics.js';
import { deviceWith } from './support/devices.js';
import { differingBytes, draw, RASTERIZERS, resized } from './support/images.js';
import { holds, isFull } from './support/row.js';

const { cloud, cameras } = offCenter();
const camera = resized(cameras[0], 64);
const kept = new URL('corpus/off-centre-64.f32', import.meta.url);

for (const rasterizer of RASTERIZERS) {
  test(`the same image on any device, ${rasterizer}`, async () => {
    const images: Float32Array[] = [];
    // Tiles take seconds to compile for each device.
    for (let i = 0; i < (rasterizer === 'quads' || isFull ? 2 : 1); i++) {
      const device = await deviceWith([]);
      images.push(await draw(device, cloud, camera, { rasterizer }));
      device.destroy();
    }
    if (images.length > 1) {
      holds('S26', `two devices of one adapter, ${rasterizer}: differing bytes`, differingBytes(images[0], images[1]), {
        atMost: 0,
        unit: 'bytes',
      });
    }
    if (process.env.STABILITY_KEEP && rasterizer === 'quads') writeFileSync(kept, Buffer.from(images[0].buffer));
    assert.ok(existsSync(kept), 'the stored image exists');
    const bytes = readFileSync(kept);
    const expected = new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
    const p999 = 255 * percentile(images[0], expected, 0.999, { channels: 4 });
    holds('S26', `99.9 % of the channels to SwiftShader's image, ${rasterizer}`, p999, { atMost: 1, unit: '/255' });
  });
}
