/** Photographs that judge files: which they are, and the cameras that took them. */
import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { LIMITS, neededDecibels } from '../../packages/cli/src/lib/gate/gate.mjs';
import { countedRows, standardError, verdictOf } from '../../packages/cli/src/lib/gate/verdicts.mjs';
import { holdOut, readPhotographs } from '../../packages/cli/src/lib/gate/photographs.mjs';

const folder = mkdtempSync(join(tmpdir(), 'photographs-'));
after(() => rmSync(folder, { recursive: true }));

/** A camera at (1, 2, 3) whose right is the world's y, whose down is its z and whose forward is its x. */
const ROTATION = [
  [0, 0, 1],
  [1, 0, 0],
  [0, 1, 0],
];
const training = ['a.JPG', 'b', 'c'].map((img_name) => ({
  ...{ img_name, width: 40, height: 30, fx: 50, fy: 51 },
  ...{ position: [1, 2, 3], rotation: ROTATION },
}));
const file = (name: string, content: unknown): string => {
  writeFileSync(join(folder, name), JSON.stringify(content));
  return join(folder, name);
};

test("cameras of training's cameras.json find their photographs", () => {
  mkdirSync(join(folder, 'images'));
  for (const name of ['a.jpg', 'b.png']) writeFileSync(join(folder, 'images', name), '');
  const cameras = file('cameras.json', training);
  assert.throws(() => readPhotographs(cameras), /view 2: expected a photograph, found no .*images.c/);
  const [a, b] = readPhotographs(cameras, undefined, ['c']);
  assert.deepEqual([a.photograph, b.photograph], [join(folder, 'images/a.jpg'), join(folder, 'images/b.png')]);
  const { worldToCamera, fx, fy, cx, cy } = a.camera;
  assert.deepEqual([fx, fy, cx, cy], [50, 51, 20, 15]);
  assert.deepEqual([...worldToCamera].slice(0, 12), [0, 1, 0, -2, 0, 0, 1, -3, 1, 0, 0, -1]);
});

test('views name their photographs; every Nth is held out', () => {
  writeFileSync(join(folder, 'v.png'), '');
  const K = [
    [50, 0, 20],
    [0, 50, 15],
    [0, 0, 1],
  ];
  const worldToCamera = [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => Number(row === column)));
  const view = { width: 40, height: 30, K, worldToCamera, image: 'v.png' };
  const found = readPhotographs(file('views.json', { views: new Array(10).fill(view) }));
  const { judging, others } = holdOut(found, 8);
  assert.deepEqual(
    judging.map(({ id }) => id),
    ['0', '8'],
  );
  assert.equal(others.length, 8);
  for (const other of [{ views: [{ width: 40 }] }, [null], [{ img_name: 'a' }]])
    assert.throws(() => readPhotographs(file('none.json', other)), /found neither/);
  writeFileSync(join(folder, 'prose.json'), 'hello');
  assert.throws(() => readPhotographs(join(folder, 'prose.json')), /prose\.json is not JSON/);
});

test('the first target loses the limit if errors are independent', () => {
  const [scene, file] = [31, neededDecibels(31)].map((decibels) => 10 ** (-decibels / 10));
  assert.ok(Math.abs(-10 * Math.log10(scene + file) - (31 - LIMITS.psnr)) < 1e-9);
});

test('losses within a standard error of a limit are undecided, and a bootstrap finds the error of the mean', () => {
  const normal = Array.from({ length: 64 }, (_, k) => Math.sin(12.9898 * (k + 1)));
  const mean = normal.reduce((sum, value) => sum + value, 0) / 64;
  const expected = Math.sqrt(normal.reduce((sum, value) => sum + (value - mean) ** 2, 0) / 64 / 64);
  assert.ok(Math.abs(standardError(normal) / expected - 1) < 0.06, `${standardError(normal)} and ${expected}`);
  assert.ok(standardError([0.1, 0.1, 0.1]) < 1e-12);
  const around = (middle: number, spread: number): number[] => [-1, 0, 1, 0].map((k) => middle + k * spread);
  const fine = { ssim: around(0.0005, 1e-4), lpips: around(0.001, 1e-4) };
  assert.equal(verdictOf({ ...fine, psnr: around(0.1, 0.02) }).verdict, 'passes');
  assert.equal(verdictOf({ ...fine, psnr: around(0.19, 0.1) }).verdict, 'undecided');
  assert.equal(verdictOf({ ...fine, psnr: around(0.21, 0.1) }).verdict, 'undecided');
  assert.equal(verdictOf({ ...fine, psnr: around(0.3, 0.02) }).verdict, 'fails');
  assert.equal(verdictOf({ ssim: around(0.0022, 1e-5), psnr: around(0.19, 0.1) }).verdict, 'fails', 'without LPIPS');
  assert.equal(verdictOf({ psnr: [0, 0], ssim: [0, 0], lpips: [0, 0] }).verdict, 'passes', 'the scene itself');
});

test('a pass counts only if its encoder passes at all higher targets', () => {
  const row = (encoder: string | undefined, target: number, passes: boolean) => ({ encoder, target, passes });
  const rows = [
    row('SOG', 42, true),
    row('SOG', 44, false),
    row('SOG', 46, true),
    row('SOG', 48, true),
    row('pages', 42, false),
    row('pages', 44, true),
    row(undefined, 0, true),
  ];
  assert.deepEqual(countedRows(rows), [rows[2], rows[3], rows[5], rows[6]]);
});
