/** `economise --gate`: a small file that loses next to nothing against photographs, which are noisy frames of the scene here. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { PNG } from 'pngjs';
import { boundsOf } from '@gaussian-splat/core';
import { decibels, economisePassing, encodingsFor, viewsAround } from '@gaussian-splat/economise';
import { readScene } from '@gaussian-splat/formats';
import { checkPython, drawPngs, Gate } from '../../packages/cli/src/lib/gate/gate.mjs';
import { holdOut, readPhotographs } from '../../packages/cli/src/lib/gate/photographs.mjs';
import { smallCloud } from '../formats/support/small-cloud.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { PaintedEvaluator } from './twin/index.js';

const folder = mkdtempSync(join(tmpdir(), 'gate-'));
after(() => rmSync(folder, { recursive: true }));
after(endNodeDevice);

const cloud = smallCloud(300, 1);
const cameras = viewsAround(boundsOf(cloud), 18, { width: 96, height: 64 });

test('the search ends within half a decibel above the target that fails', async () => {
  const views = { scored: cameras.slice(0, 12), searched: cameras.slice(12, 15), heldOut: cameras.slice(15, 18) };
  const evaluator = new PaintedEvaluator(cloud, { views });
  const tried: { passes: boolean; found: number }[] = [];
  const judge = async (written: typeof cloud): Promise<{ passes: boolean; description: string }> => {
    const errors = await evaluator.compare(written, 'heldOut');
    const found = decibels(errors.reduce((sum, error) => sum + error, 0) / errors.length);
    tried.push({ passes: found >= 37, found });
    return { passes: found >= 37, description: `${found} dB` };
  };
  const options = { name: 'a.glb', evaluator };
  const { bytes, psnr: reached } = await economisePassing(cloud, judge, options);
  assert.ok(tried.some(({ passes }) => !passes) && tried.length <= 7, JSON.stringify(tried));
  assert.ok(reached >= 37 && reached < 38.5, `${reached} dB`);
  assert.ok((await readScene(bytes, { name: 'a.glb' })).count > 0);
  await assert.rejects(
    economisePassing(cloud, async () => ({ passes: false, description: 'no' }), { ...options, name: 'a.spz' }),
    /a file that passes the gate/,
  );
});

const python = process.env.PYTHON ?? 'python3';
const without = ((): string | false => {
  try {
    checkPython(python);
    return false;
  } catch (error) {
    return (error as Error).message;
  }
})();

test('the command writes a smaller file that passes, and says by which figures', { skip: without }, async () => {
  const scene = join(folder, 'scene.ply');
  writeFileSync(scene, await encodingsFor('a.ply')[0].write({ cloud, degrees: new Uint8Array(300).fill(1) }));
  const device = await serialDevice();
  // Few views: a software rasterizer takes minutes for more.
  const few = cameras.slice(0, 12);
  const images = await drawPngs(
    device,
    cloud,
    few.map((camera, k) => ({ id: `${k}`, camera })),
    folder,
  );
  const { normal } = seededRandom(1);
  for (const image of images) {
    const png = PNG.sync.read(readFileSync(image));
    png.data.forEach((value, k) => {
      if (k % 4 < 3) png.data[k] = Math.min(255, Math.max(0, value + 6 * normal()));
    });
    writeFileSync(image, PNG.sync.write(png));
  }
  const views = few.map(({ width, height, fx, fy, cx, cy, worldToCamera }, k) => ({
    ...{ width, height, image: `${k}.png` },
    worldToCamera: [0, 1, 2, 3].map((row) => [...worldToCamera].slice(4 * row, 4 * row + 4)),
    K: [
      [fx, 0, cx],
      [0, fy, cy],
      [0, 0, 1],
    ],
  }));
  const file = join(folder, 'views.json');
  writeFileSync(file, JSON.stringify({ views }));
  const script = fileURLToPath(new URL('../../packages/cli/bin/gaussian-splat.mjs', import.meta.url));
  const out = join(folder, 'less.glb');
  const args = ['economise', scene, '--gate', file, '--python', python, '--out', out];
  const { status, stdout, stderr } = spawnSync(process.execPath, [script, ...args], { encoding: 'utf8' });
  assert.equal(status, 0, stdout + stderr);
  assert.match(stdout, /gate +2 photographs of/);
  assert.match(stdout, /gate +passes: \d+\.\d+ dB/);
  const bytes = readFileSync(out);
  assert.ok(bytes.length < readFileSync(scene).length / 3, `${bytes.length} bytes`);
  const { judging } = holdOut(readPhotographs(file), 8);
  const gate = new Gate(device, { photographs: judging, python });
  await gate.judge(cloud, 'scene');
  const found = await gate.judge(await readScene(bytes, { name: out }), 'less');
  assert.ok(found.passes, found.description);
});
