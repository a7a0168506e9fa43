/** Copies of a tree: pages from one file, and are moved to their places on the GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Vector3 } from '@gaussian-splat/core';
import { StreamedGaussians } from '@gaussian-splat/renderer';
import { constants, listPages, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { detailFolder } from '../support/detail-folder.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { anyDevice } from '../support/node-device.js';
import { readBuffer, readRows } from '../support/read-rows.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

/** Words of a chunk's box, of its details, and of the geometry and harmonics (degree 1) of its splats: docs/lod-format.md. */
const [BOX, DETAILS, GEOMETRY, SH] = [8, 12, 8 * constants.CULL_GROUP, 4 * constants.CULL_GROUP];
/** An offset without a float32 coordinate. */
const places = [0, 1, 2].map((k): Vector3 => [14.1 * k, 0.3 * k, -3.7 * k]);
const folder = detailFolder(pebbles(4_000), places);
const options = { threads: 'serial', sort: 'serial' } as const;

/** Adds to the points that begin at every multiple of a stride, in float32. */
function moved(words: Uint32Array, firsts: readonly number[], stride: number, by: Vector3): Uint32Array {
  const floats = Float32Array.from(new Float32Array(words.slice().buffer));
  for (const first of firsts) {
    for (let at = first; at < floats.length; at += stride) {
      by.forEach((shift, axis) => (floats[at + axis] += Math.fround(shift)));
    }
  }
  return new Uint32Array(floats.buffer);
}

test('after any arrivals and evictions, each slot has the words of its page in its file, all positions moved to its place once', async () => {
  const device = await anyDevice();
  const list = listPages(folder.manifest);
  const slotWords = SLOT_CHUNKS * (BOX + DETAILS + GEOMETRY + SH);
  const slots = Math.ceil(list.count / 2);
  const files = new Map([...folder.files].map(([name, bytes]) => [name, bytes.slice(0)]));
  const scene = await StreamedGaussians.open(device, folder.manifest, {
    fetchPage: (file) => Promise.resolve(files.get(file)!),
    memoryBudget: 4 * slotWords * slots,
    arrivalMs: 0,
  });
  const renderer = new Renderer(device, options);
  const seen = new Set<number | undefined>();
  for (const [x, y, z] of [...places, places[0]]) {
    const camera = cameraAt([x + 2, y - 1, z], [x, y, z], { width: 96, height: 64, fovXDegrees: 60, near: 0.01 });
    await drawUntilCalm(scene, renderer, camera, 0.2);
    for (const page of scene.pagesInSlots) seen.add(page);
  }
  assert.ok(seen.size > slots, 'some left for others');
  const [geometry, sh, boxes] = await Promise.all(
    (['geometry', 'sh', 'chunks'] as const).map(
      async (part) => new Uint32Array(await readBuffer(scene.blocks[0][part])),
    ),
  );
  const rows = await readRows(scene);
  const copies = new Set<string>();
  scene.pagesInSlots.forEach((page, slot) => {
    if (page === undefined) return;
    const { file, first, chunks } = list.place(page);
    const by = list.translate(page);
    copies.add(by.join());
    const words = new Uint32Array(folder.files.get(file.file)!);
    let from = 0;
    const part = (size: number): Uint32Array => {
      const own = words.subarray(from + size * first, from + size * (first + chunks));
      from += size * file.chunks;
      return own;
    };
    const inSlot = (all: Uint32Array, size: number): Uint32Array =>
      all.subarray(size * SLOT_CHUNKS * slot, size * (SLOT_CHUNKS * slot + chunks));
    const name = `page ${page} of ${file.file}`;
    assert.deepEqual(inSlot(boxes, BOX), moved(part(BOX), [0, 4], BOX, by), `boxes of ${name}`);
    const spheres = new Float32Array(moved(part(DETAILS), [0], DETAILS, by).buffer);
    for (let at = 0; at < spheres.length; at += DETAILS) {
      assert.deepEqual(rows[slot].subarray(at, at + 4), spheres.subarray(at, at + 4), `spheres of ${name}`);
    }
    assert.deepEqual(inSlot(geometry, GEOMETRY), moved(part(GEOMETRY), [0], 8, by), `geometry of ${name}`);
    assert.deepEqual(inSlot(sh, SH), part(SH), `harmonics of ${name}`);
  });
  assert.ok(copies.size > 1, 'pages of several copies are there');
  for (const [name, bytes] of files) assert.deepEqual(bytes, folder.files.get(name)!, `${name} is as it came`);
  [renderer, scene].forEach((owner) => owner.destroy());
});
