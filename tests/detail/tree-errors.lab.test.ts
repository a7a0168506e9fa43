/**
 * Error in pixels of streamed trees, along a flight: each frame is compared with the exact frame, and with the exact frame
 * shifted by the pixels that are allowed.
 */
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import type { Camera } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians, StreamedGaussians, type PageSource } from '@gaussian-splat/renderer';
import { treeSource } from '@gaussian-splat/renderer/tools';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { runOnPage } from '../support/element/loading.js';
import { psnr } from '../support/metrics.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { writeRadTree } from '../support/rad-tree.js';
import { readFrame } from '../support/read-frame.js';
import { Renderer } from '../support/renderer.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { splatTileset } from '../support/tileset.js';

const cloud = pebbles(20_000);
const ORIGIN = 'http://files.example/';
const files = new Map<string, Uint8Array>([
  ...splatTileset(cloud, { levels: 4 }),
  ['scene.rad', writeRadTree(cloud, { chunkSize: 4096 })],
]);

const { fetch } = globalThis;
before(() => {
  globalThis.fetch = async (input, { headers } = {}) => {
    const file = files.get(new URL(input as string).pathname.slice(1))!;
    const range = /^bytes=(\d+)-(\d+)$/.exec((headers as { Range?: string } | undefined)?.Range ?? '');
    if (!range) return new Response(file.slice());
    const [start, end] = [Number(range[1]), Math.min(file.length, Number(range[2]) + 1)];
    const sent = { 'Content-Range': `bytes ${start}-${end - 1}/${file.length}` };
    return new Response(file.slice(start, end), { status: 206, headers: sent });
  };
});
after(() => void (globalThis.fetch = fetch));
after(endNodeDevice);

/** Opens a file with the code of the element's worker. */
async function sourceOf(name: string): Promise<PageSource> {
  const { signal } = new AbortController();
  const listeners = { onProgress: () => undefined };
  const place = { url: ORIGIN + name, credentials: 'same-origin' } as const;
  const { tree, ...opened } = (await runOnPage('tree', { ...place, sh: 'auto' }, signal, listeners))!;
  return treeSource(opened, (node, above, aborted) =>
    runOnPage('node', { ...place, tree, node, scene: opened.scene, above }, aborted, listeners),
  );
}

const size = { width: 160, height: 107, fovXDegrees: 60, near: 0.01 };
/** From beside a stone to afar. */
const FLIGHT = [
  [2.5, 0.4, 3],
  [7, 2.4, 0],
  [12, 3.4, 0],
  [20, 4.4, 0],
].map(([away, angle, x]): Camera => {
  const eye = [x + away * Math.cos(angle), -0.5 * away, x + away * Math.sin(angle)] as const;
  return cameraAt([...eye], [x, 0, x], size);
});
/** The same view of the scene in a tileset, whose x and y point the other way. */
const ofTileset = (camera: Camera): Camera => ({
  ...camera,
  worldToCamera: Float64Array.from(camera.worldToCamera, (value, k) => (k < 12 && k % 4 < 2 ? -value : value)),
});
const shifted = (camera: Camera, x: number, y: number): Camera => ({
  ...camera,
  ...('cx' in camera && { cx: camera.cx + x, cy: camera.cy + y }),
});

const OPTIONS = { threads: 'serial', sort: 'serial' } as const;
const SHIFTS = [0.0625, 0.125, 0.25, 0.5, 1, 2, 3];
const EXACT = 0.02;

test('a frame within an error differs from the exact one as if that were shifted by a fifth of it on average', async () => {
  const device = await anyDevice();
  const renderer = new Renderer(device, OPTIONS);
  const plain = await GaussianBuffers.upload(device, packGaussians(cloud));
  const exactly = (camera: Camera): Promise<Float32Array> => readFrame(device, renderer, { gaussians: plain, camera });
  const truths: { readonly exact: Float32Array; readonly decibels: readonly number[] }[] = [];
  for (const camera of FLIGHT) {
    const exact = await exactly(camera);
    const decibels: number[] = [];
    for (const shift of SHIFTS) {
      const [x, y] = [await exactly(shifted(camera, shift, 0)), await exactly(shifted(camera, 0, shift))];
      decibels.push((psnr(x, exact) + psnr(y, exact)) / 2);
    }
    truths.push({ exact, decibels });
  }
  /** Returns the shift of the exact frame, in pixels, that has a PSNR; 0 below the smallest. */
  const pixelsOf = (value: number, decibels: readonly number[]): number => {
    const k = decibels.findIndex((one) => value >= one);
    if (k === 0) return 0;
    if (k < 0) return Infinity;
    const share = (decibels[k - 1] - value) / (decibels[k - 1] - decibels[k]);
    return SHIFTS[k - 1] * (SHIFTS[k] / SHIFTS[k - 1]) ** share;
  };
  for (const name of ['tileset.json', 'scene.rad']) {
    const scene = await StreamedGaussians.openSource(device, await sourceOf(name), {
      memoryBudget: 1e8,
      arrivalMs: 0,
    });
    // Coarse frames are first, because the pages of finer ones stay.
    for (const allowed of [3, 1, EXACT]) {
      const pixels: number[] = [];
      const decibels: number[] = [];
      for (const [k, camera] of FLIGHT.entries()) {
        const view = name === 'scene.rad' ? camera : ofTileset(camera);
        await drawUntilCalm(scene, renderer, view, allowed);
        const frame = await readFrame(device, renderer, { gaussians: scene, camera: view, detail: allowed });
        const value = psnr(frame, truths[k].exact);
        decibels.push(value);
        pixels.push(pixelsOf(value, truths[k].decibels));
      }
      const mean = pixels.reduce((sum, value) => sum + value, 0) / pixels.length;
      const text = `${name}, ${allowed} px: ${decibels.map((value) => value.toFixed(1)).join(' ')} dB, as a shift of ${pixels.map((value) => value.toFixed(2)).join(' ')} px, ${mean.toFixed(2)} on average`;
      console.log(text);
      if (allowed === EXACT) assert.ok(Math.min(...decibels) > 60, text);
      else assert.ok(mean < allowed / 5 && Math.max(...pixels) < allowed / 3, text);
    }
    scene.destroy();
  }
  [plain, renderer].forEach((owner) => owner.destroy());
});
