/** A splat budget of a streamed scene that grows from frame to frame: complete frames, few buffers, smaller errors. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { StreamedGaussians } from '@gaussian-splat/renderer';
import { detailFolder } from '../support/detail-folder.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { isLab } from '../support/extent.js';
import { psnr } from '../support/metrics.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { Renderer } from '../support/renderer.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';

after(endNodeDevice);

const folder = detailFolder(pebbles(6_000));
const camera = cameraAt([5, -2, 4], [0, 0, 0], { width: 48, height: 32, fovXDegrees: 60, near: 0.01 });
const DETAIL = 0.05;

// On a software GPU, `tiles` takes minutes.
for (const rasterizer of isLab ? (['quads', 'tiles'] as const) : (['quads'] as const))
  test(`${rasterizer}: a larger budget is drawn whole at once, with a smaller error that the progress has, too`, async () => {
    const device = await anyDevice();
    const { manifest, fetchPage } = folder;
    const scene = await StreamedGaussians.open(device, manifest, { fetchPage, arrivalMs: 0 });
    const [renderer, loading] = [0, 1].map(() => new Renderer(device, { threads: 'serial', rasterizer }));
    await drawUntilCalm(scene, loading, camera, DETAIL);
    assert.equal(scene.progress.budgetError, 0, 'without a budget');
    const expected = await readFrame(device, loading, { gaussians: scene, camera, detail: DETAIL });
    const target = device.createTexture({ size: [camera.width, camera.height], format: 'rgba8unorm', usage: 0x10 });
    const draw = (splatBudget: number): void =>
      renderer.render({ gaussians: scene, camera, target, detail: DETAIL, splatBudget });

    let buffers = 0;
    const create = device.createBuffer;
    device.createBuffer = (descriptor) => {
      buffers++;
      return create.call(device, descriptor);
    };
    /** Number of buffers that frames with a budget create. */
    const made = async (splatBudget: number): Promise<number> => {
      const before = buffers;
      for (let k = 0; k < 8; k++) {
        draw(splatBudget);
        await device.queue.onSubmittedWorkDone();
      }
      return buffers - before;
    };
    try {
      const found: { error: number; close: number; visible: number; bytes: number }[] = [];
      for (const splatBudget of [800, 2_000, 6_000]) {
        if (found.length > 0) {
          draw(splatBudget);
          const { visible, overflow, pairOverflow } = await renderer.stats();
          assert.deepEqual([overflow, pairOverflow], [0, 0], `the first frame of ${splatBudget} splats lacks none`);
          assert.ok(visible <= splatBudget);
        } else await made(splatBudget);
        assert.equal(await made(splatBudget), 0, 'buffers of steady frames');
        const { budgetError, visible } = await renderer.stats();
        assert.equal(scene.progress.budgetError, budgetError);
        const image = await readFrame(device, renderer, { gaussians: scene, camera, detail: DETAIL, splatBudget });
        found.push({
          error: budgetError,
          close: psnr(expected, image, { channels: 4 }),
          visible,
          bytes: renderer.byteLength,
        });
      }
      for (const { error, close, visible, bytes } of found)
        console.log(`${visible} splats, off by ${error.toFixed(2)} px, ${close.toFixed(1)} dB, ${bytes} bytes`);
      found.slice(1).forEach((next, i) => {
        assert.ok(next.error < found[i].error && next.close > found[i].close + 1, 'more splats, less error');
      });
      // A budget that falls and comes back has its buffers.
      assert.equal(await made(2_000), 0, 'a smaller budget');
      assert.equal(await made(6_000), 0, 'the larger one again');
    } finally {
      device.createBuffer = create;
    }
    [renderer, loading, scene, target].forEach((owner) => owner.destroy());
  });
