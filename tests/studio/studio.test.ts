/** The scenes of the studio and their references fit each other: cameras, depths, known lengths and sizes. */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { test } from 'node:test';
import { someOf } from '../support/extent.js';
import { isVisible, seenAt } from '../support/studio-geometry.js';
import { STUDIO, studio } from '../support/studio.js';

for (const name of someOf(STUDIO, 1)) {
  test(`${name}: known lengths end on surfaces that held-out views show`, async () => {
    const scene = await studio(name);
    const { truth, held } = scene;
    assert.equal(scene.cloud.count, truth.measured.splats);
    assert.equal(scene.cloud.antialiased, truth.training.antialiased);
    assert.equal(truth.measured.each.length, held.length);
    for (const { from, to, meters } of truth.lengths)
      assert.ok(Math.abs(Math.hypot(...from.map((v, k) => v - to[k])) - meters) < 1e-3);
    const shown = truth.lengths.filter((l) =>
      held.some((view) => [l.from, l.to].every((p) => isVisible(scene, view, p))),
    );
    assert.ok(shown.length >= (held.length > 2 ? 10 : 2), `${name}: ${shown.length} visible lengths`);
  });

  test(`${name}: splats are in front of the held-out cameras, on their images`, async () => {
    const { cloud, held } = await studio(name);
    for (const { name: view, camera } of held) {
      let inside = 0;
      for (let i = 0; i < cloud.count; i += 50) {
        const [x, y, z] = cloud.positions.subarray(3 * i, 3 * i + 3);
        const at = seenAt(camera, [x, y, z]);
        if (at.depth > 0 && at.x > 0 && at.y > 0 && at.x < camera.width && at.y < camera.height) inside++;
      }
      assert.ok(
        inside > cloud.count / 50 / 100,
        `${name} ${view}: ${inside} of ${Math.floor(cloud.count / 50)} splats`,
      );
    }
  });
}

test('the scenes, images and references take 40 MB at most, and each has its license', () => {
  const root = fileURLToPath(new URL('../../', import.meta.url));
  const bytesIn = (folder: string): number =>
    readdirSync(folder, { withFileTypes: true }).reduce((sum, entry) => {
      const path = join(folder, entry.name);
      return sum + (entry.isDirectory() ? bytesIn(path) : statSync(path).size);
    }, 0);
  const folders = [join(root, 'tests/fixtures/studio'), join(root, 'demo/scenes/studio')];
  assert.ok(folders.reduce((sum, folder) => sum + bytesIn(folder), 0) < 40e6);
  const licenses = readFileSync(join(folders[0], 'README.md'), 'utf8');
  for (const name of STUDIO) assert.match(licenses, new RegExp(`\\| ${name} \\|.*CC0`));
});
