/** `optimize --gate`: a small file that loses next to nothing against photographs, which are noisy frames of the scene here. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { PNG } from 'pngjs';
import { boundsOf } from '@gaussian-splat/core';
import { decibels, optimizePassing, encodingsFor, viewsAround, type OptimizedPassing } from '@gaussian-splat/optimize';
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

type Verdict = 'passes' | 'undecided' | 'fails';

/** Searches with verdicts by the PSNR of held-out views. */
async function search(
  verdictAt: (found: number) => Verdict,
  name = 'a.glb',
  first?: number,
): Promise<{ result: OptimizedPassing; found: Map<string, number> }> {
  const views = { scored: cameras.slice(0, 12), searched: cameras.slice(12, 15), heldOut: cameras.slice(15, 18) };
  const evaluator = new PaintedEvaluator(cloud, { views });
  const found = new Map<string, number>();
  const judge = async (written: typeof cloud): Promise<{ verdict: Verdict; description: string }> => {
    const errors = await evaluator.compare(written, 'heldOut');
    const psnr = decibels(errors.reduce((sum, error) => sum + error, 0) / errors.length);
    found.set(`${psnr} dB`, psnr);
    return { verdict: verdictAt(psnr), description: `${psnr} dB` };
  };
  return { result: await optimizePassing(cloud, judge, { name, evaluator }, first), found };
}

test('the search ends within half a decibel above the target that fails', async () => {
  const { result } = await search((found) => (found >= 37 ? 'passes' : 'fails'));
  const passing = result.tries.filter(({ verdict }) => verdict === 'passes');
  const failing = result.tries.filter(({ verdict }) => verdict === 'fails');
  assert.ok(result.psnr >= 37 && passing.at(-1)!.minPsnr - failing[0].minPsnr <= 0.5, JSON.stringify(result.tries));
  assert.equal(result.bytes.length, Math.min(...passing.map(({ bytes }) => bytes!)), 'the smallest that passes');
  assert.ok((await readScene(result.bytes, { name: 'a.glb' })).count > 0);
  const targets = result.tries.map(({ minPsnr }) => minPsnr);
  assert.deepEqual(
    targets,
    [...targets].sort((a, b) => b - a),
  );
  assert.ok(targets.length <= 10 && result.tries.some(({ verdict }) => verdict === 'fails'), JSON.stringify(targets));
  const never = search(() => 'fails', 'a.spz');
  await assert.rejects(never, /expected files that pass the gate.*dB/);
});

test('a pass below a target that fails is chance, and an undecided file does not count', async () => {
  // From 33 to 35 dB files pass by chance.
  for (const between of ['fails', 'undecided'] as const) {
    const verdictAt = (found: number): Verdict => (found >= 39 || (found >= 33 && found < 35) ? 'passes' : between);
    for (const first of [45, 34]) {
      const { result } = await search(verdictAt, 'a.glb', first);
      assert.ok(result.psnr >= 39, `${first}: ${result.psnr} dB`);
      const run = result.tries.findIndex(({ verdict }) => verdict !== 'passes');
      assert.ok(run >= 2 && result.tries[run - 1].minPsnr <= result.minPsnr, JSON.stringify(result.tries));
    }
  }
  await assert.rejects(
    search(() => 'undecided'),
    /more photographs/,
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
  // Seven of ten splats are too faint to be seen: a GLB has one precision, and only fewer splats make it smaller.
  const whole = smallCloud(1000, 1);
  whole.opacities.fill(0.002, 300);
  writeFileSync(scene, await encodingsFor('a.ply')[0].write({ cloud: whole, degrees: new Uint8Array(1000).fill(1) }));
  const device = await serialDevice();
  // Few views: a software rasterizer takes minutes for more.
  const few = cameras.slice(0, 12);
  const images = await drawPngs(
    device,
    whole,
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
  const args = ['optimize', scene, '--gate', file, '--python', python, '--out', out];
  const { status, stdout, stderr } = spawnSync(process.execPath, [script, ...args], { encoding: 'utf8' });
  assert.equal(status, 0, stdout + stderr);
  assert.match(stdout, /gate +2 photographs of/);
  assert.match(stdout, /gate +passes: \d+\.\d+ dB/);
  assert.match(stdout, /\ntried +\d+\.\d+ dB, \d+ bytes, (passes|fails|undecided): .* ± /);
  const bytes = readFileSync(out);
  assert.ok(bytes.length < readFileSync(scene).length / 3, `${bytes.length} bytes`);
  const { judging } = holdOut(readPhotographs(file), 8);
  const gate = new Gate(device, { photographs: judging, python });
  await gate.judge(whole, 'scene');
  const found = await gate.judge(await readScene(bytes, { name: out }), 'less');
  assert.ok(found.passes, found.description);
});
