/** Streamed pages while a camera moves through scenes that were trained from images, and at rest. docs/accuracy.md has the figures. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { setImmediate as turn } from 'node:timers/promises';
import { eyeOf, type Camera } from '@gaussian-splat/core';
import { viewsBetween } from '@gaussian-splat/optimize';
import { DEFAULT_STEPS } from '@gaussian-splat/optimize/pages';
import { GaussianBuffers, packGaussians, StreamedGaussians } from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';
import { listPages } from '@gaussian-splat/renderer/stages';
import { deflate } from '../../packages/cli/src/lib/encoders.mjs';
import { detailFolder } from '../support/detail-folder.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { evenly } from '../support/evenly.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { Renderer } from '../support/renderer.js';
import { resized } from '../support/scenes.js';
import { studio } from '../support/studio.js';

const serial = { threads: 'serial', sort: 'serial' } as const;
const decibels = (a: Float32Array, b: Float32Array): number => psnr(a, b, { channels: 4 });
const [min, median] = [0, 0.5].map(
  (part) => (values: readonly number[]) => [...values].sort((a, b) => a - b)[Math.floor(part * values.length)],
);

/** Poses between two cameras, both included: 2^depth steps. */
function way(from: Camera, to: Camera, depth: number): Camera[] {
  const [half] = depth === 0 ? [] : viewsBetween([from], [from, to]);
  return half ? [...way(from, half, depth - 1).slice(0, -1), ...way(half, to, depth - 1)] : [from, to];
}

/** Frames from the request of a file to its arrival. */
const LATE = 6;
/** Allowed error of levels of detail, pixels. */
const DETAIL = 1;

for (const name of ['apartment', 'garden', 'hall', 'product'] as const)
  test(`${name}: streamed pages between two views and at rest`, async () => {
    const device = await serialDevice();
    const { cloud, held } = await studio(name);
    const [plain, detailed] = await Promise.all([
      GaussianBuffers.upload(device, packGaussians(cloud)),
      GaussianBuffers.upload(device, packWithDetail(cloud)),
    ]);
    const folder = detailFolder(cloud, undefined, {
      geometry: 'quantized',
      coded: { steps: DEFAULT_STEPS, deflate },
    });
    const list = listPages(folder.manifest);
    // Files arrive at once while the scene opens and at rest, and some frames later on the way.
    let frame = Infinity;
    const late: { readonly at: number; readonly arrive: () => void }[] = [];
    const arrive = (): void => {
      while (late.length > 0 && late[0].at <= frame) late.shift()!.arrive();
    };
    const scene = await StreamedGaussians.open(device, folder.manifest, {
      fetchPage: (file) =>
        new Promise((resolve) => {
          late.push({ at: frame + LATE, arrive: () => resolve(folder.files.get(file)!.slice(0)) });
          if (frame === Infinity) arrive();
        }),
      arrivalMs: 0,
    });
    const [streaming, loaded] = [new Renderer(device, serial), new Renderer(device, serial)];
    const [from, to] = evenly(held, 6).map(({ camera }) => resized(camera, 160));
    await drawUntilCalm(scene, streaming, from, DETAIL);
    const before = scene.progress.resident;
    const found: number[] = [];
    for (const [k, camera] of way(from, to, 4).entries()) {
      frame = k;
      arrive();
      await turn();
      const image = await readFrame(device, streaming, { gaussians: scene, camera, detail: DETAIL });
      found.push(decibels(await readFrame(device, loaded, { gaussians: detailed, camera, detail: DETAIL }), image));
    }
    frame = Infinity;
    arrive();
    await drawUntilCalm(scene, streaming, to, DETAIL);
    const rest = await readFrame(device, streaming, { gaussians: scene, camera: to, detail: DETAIL });
    const settled = decibels(
      await readFrame(device, loaded, { gaussians: detailed, camera: to, detail: DETAIL }),
      rest,
    );
    const all = decibels(await readFrame(device, loaded, { gaussians: plain, camera: to }), rest);
    const bytes = [...folder.files.values()].reduce((sum, file) => sum + file.byteLength, 0);
    const distance = Math.hypot(...eyeOf(from.worldToCamera).map((value, k) => value - eyeOf(to.worldToCamera)[k]));
    const [half, low] = [median(found), min(found)];
    console.log(
      `${name}: ${list.count} pages of ${(bytes / 1e6).toFixed(1)} MB; ${found.length} frames over ${distance.toFixed(1)} m: ${found[0].toFixed(1)} dB in the first, ${half.toFixed(1)} dB in the median, ${low.toFixed(1)} dB at least, to the same levels loaded whole; at rest ${settled.toFixed(1)} dB, and ${all.toFixed(1)} dB to all splats; ${before}, then ${scene.progress.resident} pages`,
    );
    assert.equal(scene.progress.error, 0, 'all that is asked for is there');
    assert.ok(settled > 30 && half > 25, `at rest ${settled} dB, on the way ${half} dB`);
    [streaming, loaded, scene, plain, detailed].forEach((owner) => owner.destroy());
  });

after(endNodeDevice);
