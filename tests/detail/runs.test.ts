/** Levels of detail in a file (streamed SOG): packed so that one level of every node is drawn, the finest if no error is allowed. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { keepUsable, type Camera, type GaussianCloud, type LevelRun } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { packLevelRuns } from '@gaussian-splat/renderer/tools';
import { constants, DETAIL_NUMBERS } from '@gaussian-splat/renderer/stages';
import { needsSharedData, sharedFile } from '../support/data.js';
import { shareDrawn } from '../support/detail-twin.js';
import { psnr } from '../support/metrics.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

const { CULL_GROUP } = constants;

/** Three nodes with three levels, without the middle one of the second; some splats cannot be drawn. */
function nodes(): GaussianCloud {
  const cloud = pebbles(3_000);
  const counts = [
    [700, 300, 60],
    [800, 0, 90],
    [600, 400, 50],
  ];
  let first = 0;
  const levelRuns = counts.flatMap((levels, node) =>
    levels.flatMap((count, level): LevelRun[] => {
      const run = { first, count, node, level };
      first += count;
      return count > 0 ? [run] : [];
    }),
  );
  for (const i of [0, 5, 699, 700, 1100, 2999]) cloud.opacities[i] = NaN;
  return { ...cloud, levelRuns };
}

test('dropping unusable splats leaves each run its own', () => {
  const cloud = nodes();
  const before = cloud.levelRuns!.map(({ first, count }) =>
    [...cloud.opacities.subarray(first, first + count)].filter((opacity) => !Number.isNaN(opacity)),
  );
  const { count, levelRuns, opacities } = keepUsable(cloud);
  assert.equal(count, 2994);
  const found = levelRuns!.map(({ first, count: own }) => [...opacities.subarray(first, first + own)]);
  assert.deepEqual(found, before);
});

test('of every node exactly one level is drawn, or two that fade; the finest where no error is allowed', () => {
  const packed = packLevelRuns(nodes());
  const chunksOf = (counts: readonly number[]): number[] => counts.map((count) => Math.ceil(count / CULL_GROUP));
  const runs = [chunksOf([697, 299, 60]), chunksOf([799, 90]), chunksOf([600, 400, 49])];
  assert.equal(packed.count, CULL_GROUP * runs.flat().reduce((a, b) => a + b));
  assert.equal(packed.leafCount, 697 + 799 + 600);
  assert.equal(packed.details!.length, (DETAIL_NUMBERS * packed.count) / CULL_GROUP);
  const drawn = new Set<string>();
  for (let distance = 1; distance < 2000; distance *= 1.6) {
    for (const [allowed, fade] of [
      [0, 0.5],
      [1, 0],
      [1, 1],
    ]) {
      const camera: Camera = cameraAt([distance, -distance / 2, 0], [0, 0, 0], { width: 96, height: 64, near: 0.01 });
      let chunk = 0;
      runs.forEach((levels, node) => {
        const shares = levels.map((count) => {
          const own = Array.from({ length: count }, () =>
            shareDrawn(packed.details!, chunk++, { camera, allowed, fade }),
          );
          assert.equal(new Set(own).size, 1, 'the chunks of a run go together');
          return own[0];
        });
        assert.ok(Math.abs(shares.reduce((a, b) => a + b) - 1) < 1e-6, `node ${node}: ${shares.join()}`);
        if (allowed === 0) assert.equal(shares[0], 1);
        shares.forEach((share, level) => share > 0.5 && drawn.add(`${node} ${level}`));
      });
    }
  }
  assert.equal(drawn.size, 8, `every level somewhere: ${[...drawn].join(', ')}`);
});

test(
  'a streamed scene: without an error its finest level, and fewer splats the farther away',
  { skip: needsSharedData },
  async () => {
    const folder = 'scenes/playbot-streamed/';
    const openFile = async (path: string): Promise<Uint8Array> => sharedFile(folder + path);
    // The three finest are left out, which only take time here.
    const index = new TextDecoder().decode(sharedFile(`${folder}lod-meta.json`));
    const bytes = new TextEncoder().encode(index.replace(/"[012]":\{"file":\d+,"offset":\d+,"count":\d+\},?/g, ''));
    const read = (level: number | 'all'): Promise<GaussianCloud> =>
      readScene(bytes, { name: 'lod-meta.json', openFile, level });
    const device = await anyDevice();
    const upload = async (level: number | 'all'): Promise<GaussianBuffers> =>
      GaussianBuffers.upload(
        device,
        (level === 'all' ? packLevelRuns : packGaussians)(await read(level), { sh: 'float16' }),
      );
    const [levels, finest] = await Promise.all([upload('all'), upload(3)]);
    assert.equal(levels.leafCount, 31_000);
    const renderer = new Renderer(device, { threads: 'serial' });
    let last = Infinity;
    for (const distance of [2, 6, 18]) {
      const camera = cameraAt([distance, -distance / 2, 0], [0, -0.5, 0], { width: 96, height: 64, near: 0.01 });
      const truth = await readFrame(device, renderer, { gaussians: finest, camera });
      const { visible: max } = await renderer.stats();
      const exact = await readFrame(device, renderer, { gaussians: levels, camera });
      assert.ok(psnr(truth, exact, { channels: 4 }) > 90);
      const image = await readFrame(device, renderer, { gaussians: levels, camera, detail: 1 });
      const { visible } = await renderer.stats();
      const decibels = psnr(truth, image, { channels: 4, mask: truth.filter((_, i) => i % 4 === 3) });
      console.log(`from ${distance}: ${visible} of ${max} splats, ${decibels.toFixed(1)} dB at 1 px`);
      assert.ok(visible / max <= last);
      last = visible / max;
    }
    assert.ok(last < 0.5, `${last} of the splats from afar`);
    [renderer, levels, finest].forEach((owner) => owner.destroy());
  },
);

after(endNodeDevice);
