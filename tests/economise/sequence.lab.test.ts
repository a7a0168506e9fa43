/** `gaussian-splat sequence`: scene files in, a first frame and files of motion out, as near to the scene files as it says. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import type { GaussianCloud } from '@gaussian-splat/core';
import { encodingsFor } from '@gaussian-splat/economise';
import {
  framePath,
  LoadBudget,
  applyMotion,
  motionFrame,
  parseSequence,
  readMotion,
  readScene,
} from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import { pebbles } from '../support/scenes/pebbles.js';

const script = fileURLToPath(new URL('../../packages/cli/bin/gaussian-splat.mjs', import.meta.url));
const folder = mkdtempSync(join(tmpdir(), 'sequence-'));
after(() => rmSync(folder, { recursive: true }));

const SPLATS = 600;
const FRAMES = 10;

/** Pebbles that swing about. */
function frameOf(cloud: GaussianCloud, frame: number): GaussianCloud {
  const positions = cloud.positions.map((value, i) =>
    i % 3 === 1 ? value + 0.2 * Math.sin(frame / 3 + cloud.positions[i - 1]) : value,
  );
  return { ...cloud, positions };
}

const cloud = pebbles(SPLATS);
const write = async (name: string, scene: GaussianCloud): Promise<void> =>
  writeFileSync(
    join(folder, name),
    await encodingsFor('a.ply')[0].write({ cloud: scene, degrees: new Uint8Array(scene.count).fill(scene.shDegree) }),
  );
for (let frame = 0; frame < FRAMES; frame++) await write(`f${frame}.ply`, frameOf(cloud, frame));
await write('other.ply', pebbles(SPLATS + 1));
const manifest = (name: string, rest: object): void =>
  writeFileSync(join(folder, name), JSON.stringify({ gaussianSplatSequence: 1, framesPerSecond: 10, ...rest }));
manifest('film.json', { frames: 'f{0}.ply', count: FRAMES });
manifest('mixed.json', { frames: ['f0.ply', 'other.ply'] });

function command(...args: string[]): { status: number | null; said: string } {
  const found = spawnSync(process.execPath, [script, 'sequence', ...args], { encoding: 'utf8', cwd: folder });
  return { status: found.status, said: found.stderr + found.stdout };
}

test('what it cannot do is said before the work', () => {
  for (const [args, reason] of [
    [['film.json'], /--out is missing/],
    [['film.json', '--out', 'out', '--min-psnr', '90'], /--min-psnr: expected 30 to 60/],
    [['film.json', '--out', 'out', '--per-file', '1'], /--per-file/],
    [['film.json', '--out', '.'], /is not empty/],
  ] as const) {
    const { status, said } = command(...args);
    assert.equal(status, 2, said);
    assert.match(said, reason);
  }
});

test('frames are as near to the scene files as it says', { timeout: 1_200_000 }, async () => {
  const { status, said } = command('film.json', '--out', 'out', '--min-psnr', '40', '--per-file', '4');
  assert.equal(status, 0, said);
  const [, decibels] = /([\d.]+) dB in held-out views of frames/.exec(said.trim().split('\n').at(-1)!)!;
  assert.ok(Number(decibels) >= 40, said);
  const out = join(folder, 'out');
  const read = (name: string): Uint8Array => new Uint8Array(readFileSync(join(out, name)));
  assert.deepEqual(readdirSync(out).sort(), [
    'first.sog',
    'motion-0.bin',
    'motion-1.bin',
    'motion-2.bin',
    'sequence.json',
  ]);
  const sequence = parseSequence(read('sequence.json'), 'sequence.json');
  assert.deepEqual([sequence.frameCount, sequence.framesPerSecond], [FRAMES, 10]);
  const first = await readScene(read(framePath(sequence, 0)), { name: 'first.sog' });
  const order = packedOrder(cloud);
  for (let frame = 1; frame < FRAMES; frame++) {
    const { path, frame: own, frames } = motionFrame(sequence, frame)!;
    const budget = new LoadBudget(1 << 24);
    const motion = await readMotion({ bytes: read(path), name: path, splats: first.count, frames, budget });
    const moved = applyMotion(first, motion, own, path, budget);
    const asked = frameOf(cloud, frame);
    const far = order.reduce(
      (max, i, k) => Math.max(max, Math.abs(moved.positions[3 * k + 1] - asked.positions[3 * i + 1])),
      0,
    );
    assert.ok(far < 0.05, `frame ${frame}: a splat is ${far} away`);
  }
});

test('frames of other splats are refused', { timeout: 1_200_000 }, () => {
  const { status, said } = command('mixed.json', '--out', 'none', '--min-psnr', '40');
  assert.equal(status, 1, said);
  assert.match(said, /expected 600 splats in each frame/);
  assert.ok(!readdirSync(folder).includes('none'), 'nothing was written');
});
