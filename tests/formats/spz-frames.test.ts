/** In which frame real SPZ files are: what decision 22 counts. */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { readScene } from '@gaussian-splat/formats';
import { needsSharedData, sharedFile, sharedPath } from '../support/data.js';

/** Mean height of a scene, y of its frame, weighted by opacity. */
async function heightOf(bytes: Uint8Array, name: string): Promise<number> {
  const { positions, opacities, count } = await readScene(bytes, { name });
  let [sum, weights] = [0, 0];
  for (let i = 0; i < count; i++) {
    sum += opacities[i] * positions[3 * i + 1];
    weights += opacities[i];
  }
  return sum / weights;
}

test('SPZ of a captured scene stand as the PLY that they were made of', { skip: needsSharedData }, async (context) => {
  const files = readdirSync(sharedPath('formats')).filter((file) => file.endsWith('.spz'));
  const height = await heightOf(sharedFile('formats/playbot3.ply'), 'playbot3.ply');
  assert.ok(Math.abs(height) > 0.05, `a scene whose middle is not that of its frame: ${height}`);
  const upright: string[] = [];
  for (const file of files) {
    const own = await heightOf(sharedFile(`formats/${file}`), file);
    if (Math.abs(own - height) < Math.abs(own + height)) upright.push(file);
  }
  context.diagnostic(`${upright.length} of ${files.length} in right-up-back: ${upright.join(', ')}`);
  assert.deepEqual(upright, files);
});

test(
  'of one scene by two versions of splat-transform, the bytes of the header do not tell the frame',
  { skip: needsSharedData },
  async () => {
    const [old, later] = ['2.7.1', '3.7.0'].map((version) =>
      readFileSync(sharedPath(`../cases/formats/spz-splat-transform-${version}.spz`)),
    );
    const clouds = await Promise.all([old, later].map((bytes) => readScene(bytes, { name: 'a.spz' })));
    const [a, b] = clouds.map(({ positions }) => [...positions].filter((_, k) => k % 3 === 1));
    // The later one is upside down: y is mirrored.
    a.forEach((y, i) => assert.ok(Math.abs(y + b[i]) < 1e-3, `${y} and ${b[i]}`));
    assert.ok(a.some((y) => Math.abs(y) > 0.5));
  },
);
