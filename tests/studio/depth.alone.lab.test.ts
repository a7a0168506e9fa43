/** Median and expected depth of captured scenes, against the true depth of their held-out views. docs/guide/depth.md has the figures. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { GaussianBuffers, packGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import { renderDepth } from '@gaussian-splat/renderer/depth';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { studio, STUDIO, type StudioName } from '../support/studio.js';

/** Minimum coverage of compared depths. */
const COVERED = 0.9;
/** Differences that a robot can work with, as a fraction of the true depth. */
const NEAR = 0.05;

/** Relative differences from the true depth in all pixels of some held-out views that are covered, ascending. */
async function differences(name: StudioName, views: number) {
  const device = await serialDevice();
  const { cloud, held, depths } = await studio(name);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const world = new World();
  world.add({ scene: gaussians });
  const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: 'tiles' } });
  const found = { median: [] as number[], expected: [] as number[] };
  let surfaces = 0;
  for (let k = 0; k < views; k++) {
    const view = held[Math.floor((k * held.length) / views)];
    const truth = depths(view);
    const image = await renderDepth(device, viewpoint, { camera: view.camera });
    truth.depths.forEach((exact, i) => {
      if (exact === 0) return;
      surfaces++;
      const { x, y } = truth.pixel(i);
      const pixel = Math.floor(y) * image.width + Math.floor(x);
      if (image.coverage[pixel] < COVERED) return;
      found.median.push(Math.abs(image.depth[pixel] / exact - 1));
      found.expected.push(Math.abs(image.expectedDepth[pixel] / exact - 1));
    });
  }
  for (const owned of [viewpoint, gaussians]) owned.destroy();
  for (const list of Object.values(found)) list.sort((a, b) => a - b);
  return { ...found, surfaces };
}

const near = (list: readonly number[]): number => list.filter((share) => share <= NEAR).length / list.length;
const percent = (share: number): string => `${(100 * share).toFixed(1)} %`;
const describe = (list: readonly number[]): string =>
  `half within ${percent(list[Math.floor(list.length / 2)])}, ${percent(near(list))} within ${percent(NEAR)}`;

for (const name of STUDIO) {
  test(`${name}: the median depth is nearer to the true depth than the expected depth`, async () => {
    const { median, expected, surfaces } = await differences(name, 2);
    console.log(`${name}: median depth ${describe(median)}; expected depth ${describe(expected)}`);
    assert.ok(median.length > 0.5 * surfaces, `${median.length} of ${surfaces} pixels are covered`);
    assert.ok(near(median) > near(expected), 'pixels near the true depth');
    assert.ok(near(median) > 0.3, `only ${percent(near(median))} of the pixels are near the true depth`);
  });
}

after(endNodeDevice);
