/** The frames of the SPZ files of tools, which decision 22 counts. `npm run lab -- tools` counts again with the newest versions of the tools. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { shCoefficientCount } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { needsSharedData, sharedPath } from '../support/data.js';

/** Height of the brightest splat, y of a cloud's frame, which points down; and of all splats. */
async function heightsIn(path: string): Promise<{ brightest: number; all: number[] }> {
  const { positions, sh, shDegree } = await readScene(readFileSync(path), { name: path });
  const stride = 3 * shCoefficientCount(shDegree);
  const all = [...positions].filter((_, k) => k % 3 === 1);
  const brightness = all.map((_, i) => sh[stride * i] + sh[stride * i + 1] + sh[stride * i + 2]);
  return { brightest: all[brightness.indexOf(Math.max(...brightness))], all };
}

/** Conversions of one PLY by tools with their defaults. */
const CONVERSIONS = [
  'formats-3/spz-niantic-ply_to_spz.spz',
  'formats-3/spz-gsbox-4.8.4.spz',
  'formats/spz-splat-transform-3.7.0.spz',
];

test('SPZ of current tools stand as the PLY that they were made of', { skip: needsSharedData }, async () => {
  for (const file of CONVERSIONS) {
    const { brightest } = await heightsIn(sharedPath(`../cases/${file}`));
    assert.ok(Math.abs(brightest + 1) < 1e-3, `${file}: the white splat above the others is at y = ${brightest}`);
  }
});

test(
  'of one scene by two versions of splat-transform, the header does not say the frame',
  { skip: needsSharedData },
  async () => {
    const [{ all: old }, { all: later }] = await Promise.all(
      ['2.7.1', '3.7.0'].map((version) => heightsIn(sharedPath(`../cases/formats/spz-splat-transform-${version}.spz`))),
    );
    // The earlier one is upside down: y is mirrored.
    old.forEach((y, i) => assert.ok(Math.abs(y + later[i]) < 1e-3, `${y} and ${later[i]}`));
    assert.ok(old.some((y) => Math.abs(y) > 0.5));
  },
);
