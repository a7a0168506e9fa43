/** A view's page requests on the GPU: the pages that the plain rule names, a little before they are drawn, and while the camera moves those that it will need. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Camera } from '@gaussian-splat/core';
import { StreamedGaussians } from '@gaussian-splat/renderer';
import { detailFolder } from '../support/detail-folder.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { FlightPages } from '../support/flight-pages.js';
import { anyDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

const DETAIL = 0.5;
const folder = detailFolder(pebbles(20_000));
const rule = new FlightPages(folder.manifest, (file) => folder.files.get(file)!);
const options = { threads: 'serial', sort: 'serial', detailFade: 0 } as const;
const viewFrom = (distance: number): Camera =>
  cameraAt([distance, -2, 0], [0, 0, 0], { width: 96, height: 64, fovXDegrees: 60, near: 0.01 });

/** As in shaders/page_feedback.wgsl: pages are requested a little before any of their splats is drawn. */
const SOON = 0.93;
/** Pages that a view requests, by the factor of their error to the allowed one. */
function requested(camera: Camera, times = 1): Set<number> {
  const pages = new Set([0]);
  rule.request(camera, times * DETAIL, (page) => pages.add(page));
  return pages;
}

const residents = (scene: StreamedGaussians): Set<number> =>
  new Set(scene.pagesInSlots.filter((page) => page !== undefined));

test('at rest the pages are there that the plain rule names', async () => {
  const device = await anyDevice();
  for (const distance of [40, 9]) {
    const scene = await StreamedGaussians.open(device, folder.manifest, { fetchPage: folder.fetchPage });
    const renderer = new Renderer(device, options);
    const camera = viewFrom(distance);
    await drawUntilCalm(scene, renderer, camera, DETAIL);
    const found = residents(scene);
    // float32 may decide differently for a page just at the limit.
    const [min, max] = [1.001 * SOON, 0.999 * SOON].map((times) => requested(camera, times));
    for (const page of min) assert.ok(found.has(page), `${distance}: page ${page} is missing`);
    for (const page of found) assert.ok(max.has(page), `${distance}: page ${page} is not asked for`);
    assert.equal(scene.progress.error, 0);
    [renderer, scene].forEach((owner) => owner.destroy());
  }
  assert.ok(requested(viewFrom(40)).size < requested(viewFrom(9)).size);
});

test('while a camera comes nearer, pages come before it needs them', async (t) => {
  const device = await anyDevice();
  const scene = await StreamedGaussians.open(device, folder.manifest, { fetchPage: folder.fetchPage });
  const renderer = new Renderer(device, options);
  const target = device.createTexture({ size: [96, 64], format: 'rgba8unorm', usage: 0x10 });
  // Pipelines and the first view's pages are loaded.
  await drawUntilCalm(scene, renderer, viewFrom(60), DETAIL);
  const ahead = new Set<number>();
  const needed = new Set<number>();
  // A clock of 30 frames a second, however long they take here.
  let now = 1000;
  t.mock.method(performance, 'now', () => now);
  for (let distance = 60; distance > 15; now += 1000 / 30) {
    distance = Math.max(15, 60 - 0.03 * (now - 1000));
    const camera = viewFrom(distance);
    for (const page of requested(camera, 0.999 * SOON)) needed.add(page);
    renderer.render({ gaussians: scene, camera, target, detail: DETAIL });
    await device.queue.onSubmittedWorkDone();
    await new Promise((resolve) => setTimeout(resolve, 5));
    for (const page of residents(scene)) if (!needed.has(page)) ahead.add(page);
  }
  console.log(`${ahead.size} of ${residents(scene).size} pages were resident before they were needed`);
  assert.ok(ahead.size > 0);
  // Half a second further, none that would be in vain.
  for (const page of ahead)
    assert.ok(
      [5, 0.1].some((further) => requested(viewFrom(further), 0.999 * SOON).has(page)),
      `page ${page}`,
    );
  [renderer, scene, target].forEach((owner) => owner.destroy());
});
