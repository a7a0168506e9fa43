/** Pages that draw a frame only when one is asked for: views at rest load all that they need, and stop. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { setTimeout as pause } from 'node:timers/promises';
import type { Camera, Vector3 } from '@gaussian-splat/core';
import { StreamedGaussians, type StreamOptions } from '@gaussian-splat/renderer';
import { constants, listPages, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { detailFolder } from '../support/detail-folder.js';
import { onlyInLab, someOf } from '../support/extent.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

const SLOT_BYTES = 4 * SLOT_CHUNKS * (8 + 12 + constants.CULL_GROUP * (8 + 4));
const lens = { width: 96, height: 64, fovXDegrees: 60, near: 0.01 };
const besides = (target: Vector3, distance: number, angle: number): Camera =>
  cameraAt(
    [target[0] + distance * Math.cos(angle), target[1] - 1, target[2] + distance * Math.sin(angle)],
    target,
    lens,
  );

/** Minimum time of a turn in milliseconds; a second of turns without a request is rest; the maximum number of turns. */
const TURN_MS = 4;
const CALM_TURNS = 1000 / TURN_MS;
const MAX_TURNS = 20_000 / TURN_MS;

/** A scene, and its drawing callback. */
interface Page {
  readonly scene: StreamedGaussians;
  /** Draws when asked to, until no request came for a second or the turns are over: those, and no clock, so that a busy machine has as many. @returns turns from the first frame to the last */
  readonly live: (turns: number, draw: () => void) => Promise<number>;
}

async function open(
  folder: ReturnType<typeof detailFolder>,
  options: Partial<StreamOptions> & { readonly slots?: number } = {},
): Promise<Page> {
  const device = await anyDevice();
  let isAsked = true;
  const { slots = 1000, ...others } = options;
  const scene = await StreamedGaussians.open(device, folder.manifest, {
    ...{ fetchPage: folder.fetchPage, memoryBudget: slots * SLOT_BYTES, arrivalMs: 50 },
    ...others,
    onChange: () => {
      isAsked = true;
    },
  });
  const live: Page['live'] = async (turns, draw) => {
    let last = 0;
    for (let turn = 0; turn < turns && turn - last < CALM_TURNS; turn++) {
      if (isAsked) {
        isAsked = false;
        draw();
        await device.queue.onSubmittedWorkDone();
        last = turn;
      }
      await pause(TURN_MS);
    }
    return last;
  };
  return { scene, live };
}

const target = async (): Promise<GPUTexture> =>
  (await anyDevice()).createTexture({ size: [lens.width, lens.height], format: 'rgba8unorm', usage: 0x10 });
const renderer = async (): Promise<Renderer> => new Renderer(await anyDevice(), { threads: 'serial' });

test('within a budget of splats and a pool that is full, a view at rest comes to rest', async () => {
  const places = [0, 1, 2, 3, 4, 5].map((k): Vector3 => [14 * (k % 3), 0, 14 * Math.floor(k / 3)]);
  const folder = detailFolder(pebbles(40_000), places);
  const [drawing, image] = [await renderer(), await target()];
  const tight = [
    [48, 16_500, 1.4],
    [72, 24_000, 4.4],
  ];
  for (const [slots, splatBudget, angle] of someOf(tight, 1)) {
    const { scene, live } = await open(folder, { slots });
    const camera = besides([14, 0, 7], 2, angle);
    const draw = (): void => drawing.render({ gaussians: scene, camera, target: image, detail: 0.3, splatBudget });
    const took = await live(MAX_TURNS, draw);
    const { budgetError } = await drawing.stats();
    const { blocks } = scene.traffic;
    console.log(`${slots} slots: ${blocks} pages in ${took} turns; within ${budgetError.toFixed(2)} pixels`);
    assert.ok(took < 0.9 * MAX_TURNS && blocks < 4 * slots, `${blocks} pages in ${took} turns`);
    // Which limit binds depends on the order in which pages come: the budget (2.5 pixels missing) or the pool (3.3).
    const missing = Math.max(budgetError, scene.progress.error);
    assert.ok(missing > 0.3 && scene.progress.resident === slots, `${missing.toFixed(2)} pixels are missing`);
    scene.destroy();
  }
  [drawing, image].forEach((owner) => owner.destroy());
});

/** Pages of a copy that are finer than its coarsest, nearly all of them. */
const MAX_COPY_SHARE = 8;

for (const isOne of [false, true]) {
  const name = `two views of one scene, ${isOne ? 'by one renderer' : 'by a renderer each'}: both have what they need at rest, and come to rest; while one moves the other has, too`;
  test(name, { skip: isOne && onlyInLab }, async () => {
    const folder = detailFolder(pebbles(8_000), [
      [0, 0, 0],
      [60, 0, 0],
    ]);
    const list = listPages(folder.manifest);
    const copiesOf = ({ pagesInSlots }: { pagesInSlots: readonly (number | undefined)[] }): number[] =>
      [0, 60].map(
        (x) => pagesInSlots.filter((page) => page !== undefined && page > 1 && list.translate(page)[0] === x).length,
      );
    const image = await target();
    const first = await renderer();
    const drawing = [first, isOne ? first : await renderer()];
    // Without pauses, and with frames that take longer than a view waits for its feedback pass.
    for (const pauseMs of [undefined, 4, 150]) {
      const isMoving = pauseMs !== undefined;
      const { scene, live } = await open(folder);
      const [still, start] = [besides([60, 0, 0], 3, 0), performance.now()];
      const draw = (): void => {
        const other = besides([0, 0, 0], 3, isMoving ? (performance.now() - start) / 2000 : 0);
        drawing[0].render({ gaussians: scene, camera: other, target: image, detail: 0.3 });
        drawing[1].render({ gaussians: scene, camera: still, target: image, detail: 0.3 });
      };
      if (isMoving) {
        // As many as pages take to be requested, fetched and placed, more if other tests use the same CPU; and some
        // more, in which they might be evicted again.
        const isThere = (): boolean => copiesOf(scene).every((pages) => pages >= MAX_COPY_SHARE);
        const maxFrames = pauseMs > 100 ? 120 : 2400;
        for (let [frame, after] = [0, 0]; after < 40 && frame < maxFrames; after += isThere() ? 1 : 0, frame++) {
          draw();
          await (await anyDevice()).queue.onSubmittedWorkDone();
          await pause(pauseMs);
        }
      } else {
        const took = await live(MAX_TURNS, draw);
        assert.ok(took < 0.9 * MAX_TURNS, `${took} turns`);
        assert.equal(scene.progress.error, 0);
      }
      const copies = copiesOf(scene);
      console.log(`${isMoving ? 'one moves' : 'at rest'}: ${copies.join(' and ')} pages`);
      assert.ok(Math.min(...copies) >= MAX_COPY_SHARE, `pages of the copies: ${copies.join()}`);
      scene.destroy();
    }
    [image, ...new Set(drawing)].forEach((owner) => owner.destroy());
  });
}

test('pages that do not come are asked for again, though the view is at rest', async () => {
  const folder = detailFolder(pebbles(6_000));
  const errors: unknown[] = [];
  let isDown = true;
  const { scene, live } = await open(folder, {
    fetchPage: (file) =>
      isDown && file !== 'pages/scene-00000.bin'
        ? Promise.reject(new Error(`${file}: offline`))
        : folder.fetchPage(file),
    onError: (error) => errors.push(error),
  });
  const [drawing, image] = [await renderer(), await target()];
  const draw = (): void =>
    drawing.render({ gaussians: scene, camera: besides([0, 0, 0], 4, 1), target: image, detail: 0.2 });
  for (let round = 0; round < 40 && errors.length === 0; round++) await live(25, draw);
  const { resident } = scene.progress;
  assert.ok(errors.length > 0 && scene.progress.error > 0.2);
  isDown = false;
  // Requested again after four seconds; later, if a busy machine has had a second failure.
  for (let round = 0; round < 60 && scene.progress.error > 0; round++) {
    await pause(500);
    await live(50, draw);
  }
  assert.ok(scene.progress.resident > resident && scene.progress.error === 0, JSON.stringify(scene.progress));
  [drawing, image, scene].forEach((owner) => owner.destroy());
});

after(endNodeDevice);
