/**
 * S11. More than 65,535 workgroups.
 *
 * Who fails: WebGPU makes an indirect dispatch beyond the limit do nothing, in silence: WebSplatter's sort (256 keys a group, one dimension) does nothing beyond
 * 16.78 million visible splats (read in its source); web-splat #8 (20 million splats), PlayCanvas #8561 and #8841.
 *
 * Recipe: asked for 16.7, 16.8 and 40 million splats. Run so; `npm test` has the rules of the shaders' text alone.
 *
 * Passes: 16.7, 16.8 and 40 million splats give the image of their visible part; every dispatch is a grid within the limits.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import { GaussianBuffers } from '@gaussian-splat/renderer';
import { dispatchGrid } from '@gaussian-splat/renderer/stages';
import { nodeDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import { spreadOver, visiblePart } from './support/large-scene.js';
import { compareImage, truth, yawed, THREADS } from './support/images.js';
import { fullTest, holds } from './support/row.js';
import { loopBodies, shaderTexts } from './support/sources.js';
import { capture, Renderer } from '../support/renderer.js';

const visible = visiblePart(2000);
const camera = cameraAt([0, 0, -2], [0, 0, 0], { width: 120, height: 90 });

async function drawLarge(count: number): Promise<void> {
  const device = await nodeDevice();
  const gaussians = await GaussianBuffers.upload(device, spreadOver(visible, count));
  const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'quads' });
  const close = compareImage(await capture(device, renderer, { gaussians, camera }), truth(visible, camera));
  holds('S11', `${count / 1e6} million splats in ${gaussians.blocks.length} pages, in order`, close.psnr, {
    atLeast: 59,
    unit: 'dB',
  });
  const turned = yawed(camera, 0.1);
  const other = compareImage(await capture(device, renderer, { gaussians, camera: turned }), truth(visible, turned));
  holds('S11', `${count / 1e6} million splats, turning`, other.psnr, { atLeast: 59, unit: 'dB' });
  renderer.destroy();
  gaussians.destroy();
}

fullTest('16.7 million splats', () => drawLarge(16_700_000));
fullTest('16.8 million splats, more groups than one dimension has', () => drawLarge(16_800_000));
fullTest('40 million splats at default limits', () => drawLarge(40_000_000));

test('every shader that runs over splats finds its group in two dimensions', () => {
  // There are 256 digits.
  const bounded = ['sort_scan.wgsl'];
  const linear = [...shaderTexts()]
    .filter(
      ([name, text]) =>
        !bounded.includes(name) &&
        /@compute/.test(text) &&
        /workgroup_id\.x\s*\*/.test(text) &&
        !/group_index/.test(text),
    )
    .map(([name]) => name);
  assert.deepEqual(linear, []);
  assert.ok(loopBodies('for (var i = 0u; i < 3u; i++) { if (a) { b(); } } c();')[0].endsWith('b(); } }'));
});

test('a grid covers any number of groups within the limits', () => {
  fc.assert(
    fc.property(fc.integer({ min: 1, max: 65535 * 65535 }), (groups) => {
      const [columns, rows] = dispatchGrid(groups);
      return columns <= 65535 && rows <= 65535 && columns * rows >= groups && columns * (rows - 1) < groups;
    }),
    { numRuns: 2000 },
  );
});
