/** Photographs that judge files: which they are, and the cameras that took them. */
import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { LIMITS, neededDecibels } from '../../packages/cli/src/lib/gate/gate.mjs';
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
