/**
 * S6. Opacities 0, 1 and around the rules; colors below 0 and above 1.
 *
 * Who fails: renderers that accumulate into unorm targets clamp colors above 1 (58.9 dB, worst pixel 54/255 by a float64 emulation); caps of
 * 1.0 (Spark) and 0.999 (brush) and floors of 0.5/255 (Spark) differ from the trainer's (76 dB, 52 dB, also emulated).
 *
 * Recipe: asked for a series of opacities and colors beyond white, at 75 dB. Run so in the quality `reference`; the default has a limit of 59.
 *
 * Passes: 75 dB or more in the `reference` quality, as far as a display shows it; 59 in the default. Colors up to 4 times white are kept
 * in float16, which is 73 dB for a peak of 1 before a display clamps them.
 */
import { test } from 'node:test';
import { toRgba } from '../oracle/oracle.js';
import { psnr } from '../support/metrics.js';
import { nodeDevice } from '../support/node-device.js';
import { brightColors, opacitySteps } from '../support/scenes.js';
import { compareImage, draw, RASTERIZERS, REFERENCE, resized, truth } from './support/images.js';
import { holds, note, sized } from './support/row.js';

for (const make of [opacitySteps, brightColors]) {
  test(make.name, async () => {
    const device = await nodeDevice();
    const { cloud, cameras } = make();
    const camera = resized(cameras[0], sized(160, 480));
    const oracle = truth(cloud, camera);
    const precise = await draw(device, cloud, camera, REFERENCE);
    const shown = psnr(precise, toRgba(oracle), { mask: oracle.contributors, channels: 4, clamp: true });
    holds('S6', `${make.name}, reference, as displays show it`, shown, { atLeast: 75, unit: 'dB' });
    note('S6', `${make.name}, reference, brighter than white included`, compareImage(precise, oracle).psnr, {
      unit: 'dB',
    });
    for (const rasterizer of RASTERIZERS) {
      const { psnr } = compareImage(await draw(device, cloud, camera, { rasterizer }), oracle);
      holds('S6', `${make.name}, default, ${rasterizer}`, psnr, { atLeast: 59, unit: 'dB' });
    }
  });
}
