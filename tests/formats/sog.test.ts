import assert from 'node:assert/strict';
import { test } from 'node:test';
import { zipSync } from 'fflate';
import { writeSog as writeBundle } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';
import {
  assertAtMost,
  assertSameCloud,
  coefficient,
  expectRefusal,
  largestDifference,
  largestRotationError,
} from './support/expect.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog, writeSogV1, type SogFiles } from './support/sog-writer.js';
import { writeWebp } from './support/webp-writer.js';

const cloud = smallCloud(300, 2);
const bundle = (files: SogFiles): Uint8Array => zipSync(files, { level: 6 });
const folder =
  (files: SogFiles) =>
  async (path: string): Promise<Uint8Array> =>
    files[path] ?? Promise.reject(new Error(`no ${path}`));

test('version 2, bundle and folder, give every attribute to the bits of the format', async () => {
  const files = writeSog(cloud);
  const read = await readScene(bundle(files), { name: 'a.sog' });
  assert.deepEqual([read.count, read.shDegree, read.droppedCount], [300, 2, 0]);
  assertAtMost(largestDifference(read.positions, cloud.positions), (2 * Math.log(3) * 1.5) / 65_535, 'positions');
  assertAtMost(largestRotationError(read, cloud), 3e-5, 'rotations');
  assertAtMost(largestDifference(read.opacities, cloud.opacities), 0.5 / 255 + 1e-6, 'opacities');
  assertAtMost(largestDifference(read.sh, cloud.sh), 0.02, 'colors');
  const logs = (values: Float32Array): number[] => Array.from(values, Math.log);
  assertAtMost(largestDifference(logs(read.scales), logs(cloud.scales)), 0.1, 'logarithms of scales');
  const unpacked = await readScene(files['meta.json'], { name: 'meta.json', openFile: folder(files) });
  assert.deepEqual(unpacked, read);
});

test('flat splats remain flat in a SOG of optimize', async () => {
  const scales = cloud.scales.map((scale, k) => (k % 3 === 2 ? 0 : scale));
  const steps = { place: 1, size: 1e-3, turn: 1, opacity: 1, color: 1e-3, harmonics: 1e-3 };
  const encodeWebp = async (rgba: Uint8ClampedArray, width: number, height: number): Promise<Uint8Array> =>
    writeWebp(new Uint8Array(rgba), width, height);
  const file = await writeBundle({ ...cloud, scales }, { steps, palette: 64, encodeWebp });
  const read = await readScene(file, { name: 'a.sog' });
  for (let i = 0; i < read.count; i++) {
    const [a, b, c] = read.scales.subarray(3 * i, 3 * i + 3);
    assertAtMost(c / Math.max(a, b), 1.1e-4, `thickness of splat ${i}`);
  }
});

test('version 1 gives every attribute to the bits of the format', async () => {
  const files = writeSogV1(cloud);
  const read = await readScene(files['meta.json'], { name: 'meta.json', openFile: folder(files) });
  assert.deepEqual([read.count, read.shDegree], [300, 0]);
  assertAtMost(largestRotationError(read, cloud), 3e-5, 'rotations');
  assertAtMost(largestDifference(read.opacities, cloud.opacities), 0.01, 'opacities');
  assertAtMost(largestDifference(read.sh, coefficient(cloud, 0)), 0.5 * (2 / 255) + 1e-5, 'colors');
});

test('a codebook without its first entry, as early tools wrote it, goes on one step below the second', async () => {
  const files = writeSog(cloud);
  const meta = JSON.parse(new TextDecoder().decode(files['meta.json'])) as Record<
    'scales' | 'sh0' | 'shN',
    { codebook: (number | null)[] }
  >;
  const whole = structuredClone(meta);
  for (const key of ['scales', 'sh0', 'shN'] as const) {
    const [, second] = meta[key].codebook as number[];
    const last = meta[key].codebook[255] as number;
    meta[key].codebook[0] = null;
    whole[key].codebook[0] = second + (second - last) / 255;
  }
  const read = (description: object) => {
    const json = new TextEncoder().encode(JSON.stringify(description));
    return readScene(bundle({ ...files, 'meta.json': json }), { name: 'a.sog' });
  };
  assertSameCloud(await read(meta), await read(whole));
  meta.scales.codebook[7] = null;
  const json = new TextEncoder().encode(JSON.stringify(meta));
  await expectRefusal(bundle({ ...files, 'meta.json': json }), 'decode/header', /scales\.codebook/, { name: 'a.sog' });
});

test('2D Gaussians, as splat-transform marks them, bring a warning', async () => {
  const files = writeSog(cloud);
  const meta = JSON.parse(new TextDecoder().decode(files['meta.json'])) as object;
  const marked = { ...files, 'meta.json': new TextEncoder().encode(JSON.stringify({ ...meta, model: '2dgs' })) };
  assert.match((await readScene(bundle(marked), { name: 'a.sog' })).warnings?.join() ?? '', /2DGS/);
  assert.equal((await readScene(bundle(files), { name: 'a.sog' })).warnings, undefined);
});

test('images and descriptions that contradict each other are refused by name', async () => {
  const files = writeSog(cloud);
  const meta = JSON.parse(new TextDecoder().decode(files['meta.json'])) as Record<string, Record<string, unknown>>;
  const changed = (change: (m: typeof meta) => unknown): Uint8Array => {
    const copy = structuredClone(meta);
    change(copy);
    return bundle({ ...files, 'meta.json': new TextEncoder().encode(JSON.stringify(copy)) });
  };
  const cases: [string, Uint8Array, string, RegExp][] = [
    [
      'more splats than pixels',
      changed((m) => Object.assign(m, { count: 1000 })),
      'decode/corrupt',
      /1,000 pixels, one/,
    ],
    ['a billion splats', changed((m) => Object.assign(m, { count: 1e9 })), 'decode/header', /at most .* splats in/],
    ['a missing image', changed((m) => (m.sh0.files = ['x.webp'])), 'decode/corrupt', /"x.webp"/],
    ['another degree', changed((m) => (m.shN.bands = 3)), 'decode/corrupt', /palette 960 pixels wide, found 512/],
    ['no codebook', changed((m) => delete m.scales.codebook), 'decode/header', /scales.codebook/],
    ['a lossy image', bundle({ ...files, 'sh0.webp': lossy() }), 'decode/unsupported', /lossy/],
    [
      'a huge image',
      bundle({ ...files, 'quats.webp': huge() }),
      'decode/corrupt',
      /at most .* pixels, found 16384 x 16384/,
    ],
  ];
  for (const [what, file, code, message] of cases) {
    const error = await expectRefusal(file, code, message, { name: 'a.sog' });
    assert.ok(error, what);
  }
});

function lossy(): Uint8Array {
  return new Uint8Array(Buffer.from('RIFF\x16\0\0\0WEBPVP8 \x0a\0\0\0\0\0\0\0\0\0\0\0\0\0', 'latin1'));
}

/** Announces 16384 x 16384 pixels of one color, which needs no bits. */
function huge(): Uint8Array {
  return new Uint8Array(
    Buffer.from('RIFF\x20\0\0\0WEBPVP8L\x10\0\0\0\x2f\xff\xff\xff\x1f\0\0\0\0\0\0\0\0\0\0\0', 'latin1'),
  );
}

test('if version 2 does not declare its number of bands, the width of their texture determines it, as in PlayCanvas', async () => {
  const files = writeSog(cloud);
  const read = async (changed: SogFiles) =>
    readScene(changed['meta.json'], { name: 'meta.json', openFile: folder(changed) });
  const meta = JSON.parse(new TextDecoder().decode(files['meta.json']));
  delete meta.shN.bands;
  delete meta.shN.count;
  const silent = { ...files, 'meta.json': new TextEncoder().encode(JSON.stringify(meta)) };
  assert.deepEqual(await read(silent), await read(files));
});
