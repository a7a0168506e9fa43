/** Every writer stores a file's metadata, up, order and filter, or the splats are turned, or the conversion is refused. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { strFromU8, unzipSync } from 'fflate';
import { encodingsFor, writeSog, writeStreamedSog, type SogOptions } from '@gaussian-splat/optimize';
import { buildDetailTree, cutPages, manifestOf } from '@gaussian-splat/optimize/pages';
import { readScene } from '@gaussian-splat/formats';
import type { CloudHints, GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { smallCloud } from '../formats/support/small-cloud.js';

const COUNT = 300;
const fine: SogOptions = {
  steps: { place: 1, size: 1e-3, turn: 1, opacity: 1, color: 1e-3, harmonics: 1e-3 },
  palette: 1024,
  encodeWebp,
  effort: 0,
};
const degrees = new Uint8Array(COUNT).fill(1);
const encoded = (name: string) => (cloud: GaussianCloud) =>
  Promise.resolve(encodingsFor(name, cloud).at(-1)!.write({ cloud, degrees }));

const WRITERS: Readonly<Record<string, (cloud: GaussianCloud) => Promise<GaussianCloud>>> = {
  ply: async (cloud) => readScene(await encoded('a.ply')(cloud), { name: 'a.ply' }),
  spz: async (cloud) => readScene(await encoded('a.spz')(cloud), { name: 'a.spz' }),
  glb: async (cloud) => readScene(await encoded('a.glb')(cloud), { name: 'a.glb' }),
  sog: async (cloud) => readScene(await writeSog(cloud, fine), { name: 'a.sog' }),
  'lod-meta': async (cloud) => {
    const files = await writeStreamedSog(cloud, fine);
    const openFile = async (path: string): Promise<Uint8Array> => files.get(path)!;
    return readScene(files.get('lod-meta.json')!, { name: 'lod-meta.json', openFile });
  },
};

/** Splats whose first two coefficients and position identify them: opacities differ. */
function sourceWith(hints: CloudHints, more: Partial<GaussianCloud> = {}): GaussianCloud {
  const cloud = smallCloud(COUNT, 1);
  // Linear harmonics of one direction that turns along: brighter as seen from the first axis of the world.
  for (let i = 0; i < COUNT; i++) {
    cloud.opacities[i] = 0.2 + (0.7 * i) / COUNT;
    cloud.sh.fill(0.4, 12 * i + 9, 12 * i + 12);
    cloud.sh.fill(0, 12 * i + 3, 12 * i + 9);
  }
  return { ...cloud, hints, ...more };
}

/** Numbers of a cloud's splats by their opacities, which all writers keep to a byte. */
const byOpacity = ({ opacities, count }: GaussianCloud): number[] =>
  Array.from({ length: count }, (_, i) => i).sort((a, b) => opacities[a] - opacities[b]);

const UPS: readonly Vector3[] = [
  [0, 0, 1],
  [0, 1, 0],
  [0.6, -0.64, 0.48],
];

for (const [name, written] of Object.entries(WRITERS)) {
  for (const up of UPS) {
    test(`${name} of a scene whose up is ${up.join(' ')}: heights and colors are above what they were above`, async () => {
      const source = sourceWith({ up });
      const before = source.positions.slice();
      const found = await written(source);
      assert.deepEqual(source.positions, before, 'the source is not changed');
      const foundUp = found.hints?.up ?? [0, -1, 0];
      if (name === 'ply') up.forEach((x, k) => assert.ok(Math.abs(x - foundUp[k]) < 1e-6));
      const height = ({ positions, origin }: GaussianCloud, axis: readonly number[], i: number): number =>
        axis.reduce((sum, x, k) => sum + x * (positions[3 * i + k] + origin[k]), 0);
      // Coefficients of degree 1 are -y, z and -x in that order, so they give the direction in which a splat is
      // brightest.
      const brightest = ({ sh }: GaussianCloud, i: number): number[] => [
        -sh[12 * i + 9],
        -sh[12 * i + 3],
        sh[12 * i + 6],
      ];
      const [mine, theirs] = [byOpacity(source), byOpacity(found)];
      let worst = 0;
      let color = 0;
      mine.forEach((i, n) => {
        // Neighbors in opacity may be one byte apart.
        const near = theirs.slice(Math.max(0, n - 2), n + 3);
        const errors = near.map((j) => Math.abs(height(source, up, i) - height(found, foundUp, j)));
        worst = Math.max(worst, Math.min(...errors));
        const along = (cloud: GaussianCloud, axis: readonly number[], k: number): number =>
          brightest(cloud, k).reduce((sum, x, a) => sum + x * axis[a], 0);
        color = Math.max(color, Math.abs(along(source, up, i) - along(found, foundUp, theirs[n])));
      });
      assert.ok(worst < 0.02, `heights differ by ${worst}`);
      assert.ok(color < 0.03, `brightness along up differs by ${color}`);
    });
  }

  test(`${name} keeps the order of a scene that was trained with one`, async () => {
    assert.equal((await written(sourceWith({ order: 'pixel' }))).hints?.order, 'pixel');
    assert.equal((await written(sourceWith({}))).hints?.order, undefined);
  });

  for (const filter of [
    { antialiased: true, filterVariance: undefined },
    { antialiased: true, filterVariance: 0.1 },
    { antialiased: false, filterVariance: 0.1 },
  ]) {
    test(`${name} keeps or refuses the filter ${filter.antialiased ? 'compensated' : 'classic'} ${filter.filterVariance ?? 0.3}`, async () => {
      const source = sourceWith({}, filter);
      const file = name === 'lod-meta' ? 'lod-meta.json' : `a.${name}`;
      try {
        encodingsFor(file, source, { encodeWebp });
      } catch (error) {
        assert.match((error as Error).message, /filter/);
        return assert.notEqual(name, 'ply');
      }
      const found = await written(source);
      assert.equal(found.antialiased, filter.antialiased);
      assert.equal(found.filterVariance ?? 0.3, filter.filterVariance ?? 0.3);
    });
  }
}

test('codebooks of SOG have the 256 values that its specification wants, and say whether splats are compensated', async () => {
  const { 'meta.json': json } = unzipSync(
    await writeSog(sourceWith({}), { ...fine, steps: { ...fine.steps, size: 1, color: 1 } }),
  );
  const meta = JSON.parse(strFromU8(json)) as Record<'scales' | 'sh0' | 'shN', { codebook: number[] }> & {
    antialias?: boolean;
  };
  for (const name of ['scales', 'sh0', 'shN'] as const) {
    assert.equal(meta[name].codebook.length, 256, name);
    assert.ok(meta[name].codebook.every(Number.isFinite), name);
  }
  assert.equal(meta.antialias, false);
});

test('pages of a scene with another up are turned, and their manifest names the order', () => {
  const source = sourceWith({ up: [0, 0, 1], order: 'pixel' });
  const tree = buildDetailTree(source);
  const manifest = manifestOf(tree, cutPages(tree), () => 'a.bin');
  const heights = Array.from({ length: COUNT }, (_, i) => source.positions[3 * i + 2]);
  const [min, max] = [Math.min(...heights), Math.max(...heights)];
  assert.ok(Math.abs(manifest.bounds.min[1] + max) < 1e-3 && Math.abs(manifest.bounds.max[1] + min) < 1e-3);
  assert.equal(manifest.order, 'pixel');
});
