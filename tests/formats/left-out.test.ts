/** Dropped parts of a file are reported: by a warning with counts, or an error if no usable part is left. Unsupported formats are named. */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { zipSync } from 'fflate';
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { needsSharedData, sharedPath } from '../support/data.js';
import { assertAtMost, expectRefusal, largestDifference } from './support/expect.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';
import { writePly, type PlyColumn, type PlyWriterElement } from './support/ply-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { inriaColumns, rawSplats } from './support/splats.js';
import { writeSpz } from './support/spz-writer.js';

const text = (words: string): Uint8Array => new TextEncoder().encode(words);
const column = (name: string, count: number, value = 0): PlyColumn => ({
  name,
  type: 'float',
  values: new Array<number>(count).fill(value),
});

/** A PLY of 100 splats whose first splats, by a count, have a value that cannot be drawn. */
function spoiled(count: number, property: string, value: number): Uint8Array {
  const columns = inriaColumns(rawSplats(100, 0)).map((own) =>
    own.name === property ? { ...own, values: [...own.values].map((v, i) => (i < count ? value : Number(v))) } : own,
  );
  return writePly([{ name: 'vertex', columns }]);
}

const warningsOf = async (file: Uint8Array, name = 'a.ply'): Promise<readonly string[]> =>
  (await readScene(file, { name })).warnings ?? [];

test('more than 5 % of unusable splats are a warning with counts and reasons', async () => {
  assert.deepEqual(await warningsOf(spoiled(5, 'x', NaN)), []);
  assert.deepEqual(await warningsOf(spoiled(6, 'x', NaN)), [
    '6 of 100 splats cannot be drawn: 6 with values that are not finite or too large. They are left out.',
  ]);
  assert.match((await warningsOf(spoiled(50, 'scale_0', NaN)))[0], /50 of 100/);
});

test('a scene of which next to nothing can be drawn is an error', async () => {
  assert.equal((await readScene(spoiled(90, 'x', NaN), { name: 'a.ply' })).count, 10);
  await expectRefusal(spoiled(91, 'x', NaN), 'decode/corrupt', /91 of 100 splats cannot be drawn: 91 with values/);
});

test('a PLY whose header states the wrong byte order is an error, although some of its splats can be drawn', async () => {
  const big = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(300, 0)) }], {
    encoding: 'binary_big_endian',
  });
  const wrong = Buffer.from(Buffer.from(big).toString('latin1').replace('_big_', '_little_'), 'latin1');
  await expectRefusal(wrong, 'decode/corrupt', /byte order that its header states/);
});

test('triangles beside splats, in PLY and glTF', async () => {
  const vertex: PlyWriterElement = { name: 'vertex', columns: inriaColumns(rawSplats(5, 0)) };
  const face: PlyWriterElement = { name: 'face', columns: [column('weight', 7)] };
  assert.match((await warningsOf(writePly([vertex, face])))[0], /7 rows of "face" are left out/);
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(40, 0) }]], [{ mesh: 0 }], [0]);
  const glb = (more: object): Uint8Array => writeGlb({ ...json, ...more }, buffer);
  assert.deepEqual(await warningsOf(glb({}), 'a.glb'), []);
  const [mesh] = json.meshes as { primitives: object[] }[];
  const meshes = [{ primitives: [...mesh.primitives, { attributes: { POSITION: 0 } }] }];
  const extensionsUsed = ['KHR_gaussian_splatting', 'KHR_lights_punctual', 'EXT_splat_motion'];
  // A hint reports the file's meshes: callers that draw them, as the element does, omit nothing.
  const both = await readScene(glb({ meshes, extensionsUsed }), { name: 'a.glb' });
  assert.deepEqual([both.hints?.meshes, both.warnings ?? []], [true, []]);
  assert.match((await warningsOf(glb({ animations: [{}] }), 'a.glb'))[0], /^1 animations are left out: the splats/);
  assert.match((await warningsOf(glb({ extensionsUsed }), 'a.glb'))[0], /not known are left out: EXT_splat_motion\./);
});

test('properties of splats that are not known are named; those that change nothing are not', async () => {
  const plain = inriaColumns(rawSplats(5, 0));
  const read = (...names: string[]): Promise<readonly string[]> =>
    warningsOf(writePly([{ name: 'vertex', columns: [...plain, ...names.map((name) => column(name, 5))] }]));
  assert.deepEqual(await read('obj_dc_0', 'semantic_id', 'label'), []);
  assert.match((await read('t', 'scale_t', 'motion'))[0], /left out: t, scale_t, motion\. If they move or recolor/);
  assert.match((await warningsOf(writePly([{ name: 'vertex', columns: plain }]), 'x/offset.ply'))[0], /LAM/);
});

test('degree 4 and extensions of SPZ', async () => {
  const rest = Array.from({ length: 72 }, (_, k) => column(`f_rest_${k}`, 5));
  const four = writePly([{ name: 'vertex', columns: [...inriaColumns(rawSplats(5, 0)), ...rest] }]);
  assert.match((await warningsOf(four))[0], /degree 4 are drawn up to degree 3/);
  const three = writePly([{ name: 'vertex', columns: [...inriaColumns(rawSplats(5, 0)), ...rest.slice(0, 45)] }]);
  assert.deepEqual(await warningsOf(three), []);
  const record = new Uint8Array(new Uint32Array([0x12345678, 4, 0]).buffer);
  const splats = rawSplats(5, 0);
  const [left] = await warningsOf(writeSpz(splats, { version: 4, extensions: record }), 'a.spz');
  assert.equal(left, 'The SPZ extension 0x12345678 is left out.');
});

const TWELVE = new Uint8Array(12);
const archive = (...paths: string[]): Uint8Array => zipSync(Object.fromEntries(paths.map((path) => [path, text('x')])));
const NAMED: readonly [name: string, bytes: Uint8Array, kind: RegExp, remedy: RegExp][] = [
  ['scene.pt', archive('archive/data.pkl', 'archive/data/0'), /checkpoint of PyTorch/, /as PLY/],
  ['blob', archive('ckpt_29999/data.pkl', 'ckpt_29999/version'), /checkpoint of PyTorch/, /as PLY/],
  ['old.pth', TWELVE, /checkpoint of PyTorch/, /as PLY/],
  ['scene.npz', archive('means.npy', 'scales.npy'), /arrays of NumPy/, /as PLY/],
  ['scene.slpk', archive('3dSceneLayer.json.gz', 'nodes/0'), /I3S/, /convert/i],
  ['0.b3dm', TWELVE, /3D Tiles/, /\.glb/],
  ['reply', text('{"geometricError": 1, "root": {"children": []}, "x": 1}'), /3D Tiles/, /\.glb/],
  ['scene.splatv', TWELVE, /splatv/, /sequence/],
  ['reply', Uint8Array.of(0x4b, 0x67, 0, 0, 9, 0, 0, 0, 91), /splatv/, /sequence/],
];
for (const [name, bytes, kind, remedy] of NAMED) {
  test(`${name} of ${bytes.length} bytes is named: ${kind.source}`, async () => {
    const { code, message } = await readScene(bytes, { name }).then(
      () => assert.fail('it was read'),
      (error: GaussianSplatError) => error,
    );
    assert.match(message, kind);
    assert.match(message, remedy);
    assert.equal(code, 'decode/unsupported');
  });
}

test('extensions that a glTF requires are named, with what to do', async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(40, 0) }]], [{ mesh: 0 }], [0]);
  for (const [extension, remedy] of [
    ['KHR_spz_gaussian_splats_compression', /compression_spz_2/],
    ['KHR_gaussian_splatting_lgsc', /SPZ or PLY/],
  ] as const) {
    const file = writeGlb({ ...json, extensionsRequired: [extension] }, buffer);
    const { message } = await expectRefusal(file, 'decode/unsupported', new RegExp(extension), { name: 'a.glb' });
    assert.match(message, remedy);
  }
});

/** Each case of the review of formats: read, with its metadata, or refused by its right name. */
const CASES: Readonly<Record<string, RegExp>> = {
  'axes-source.ply': /^3 splats classic$/,
  'glb-3.7.0-right.glb': /^3 splats classic$/,
  'glb-legacy-cesium-spz.glb': /decode\/unsupported.*KHR_spz_gaussian_splats_compression/,
  'glb-log-scales-2.3.1.glb': /^3 splats classic The glTF has logarithms/,
  'gsplat-png-meta.json': /decode\/unsupported.*gsplat's PNG compression/,
  'mip-source.ply': /^\d+ splats 0\.1$/,
  'scene.lcc': /decode\/header.*attributes, scale: expected min and max/,
  'spz-splat-transform-2.7.1.spz': /^3 splats classic assumed The file does not name its axes, .*set up="y"\.$/,
  'spz-splat-transform-3.7.0.spz': /^3 splats classic assumed The file does not name its axes, .*set up="y"\.$/,
  'stg-lite.ply': /decode\/unsupported.*SpacetimeGaussians/,
  'tileset.json': /decode\/unsupported.*0\/0\.glb: expected a way to open the other files/,
  'up-nerfstudio-z.ply': /^\d+ splats classic up 0 0 1$/,
};
/** Cases of the third review; opacities and the first position that their source has. */
const LATER_CASES: Readonly<Record<string, RegExp>> = {
  'activated.ply': /^60 splats classic No scale_/,
  'axes-source.ply': /^3 splats classic$/,
  'glb-gsbox-4.8.4.glb': /^60 splats classic The glTF has logarithms .* and logits/,
  'khr-linear.glb': /^60 splats classic Colors are linear/,
  'khr-log-mixed.glb': /^60 splats classic The glTF has logarithms in place of scales,/,
  'khr-log.glb': /^60 splats classic The glTF has logarithms in place of scales,/,
  'khr-logit-only.glb': /^60 splats classic The glTF has logits in place of opacities,/,
  'khr-right.glb': /^60 splats classic$/,
  'opacity-plain.ply': /^60 splats classic All opacities/,
  'scene.spx': /decode\/unsupported.*Reall3dViewer/,
  'sharp-colorspace-1.ply': /^60 splats classic Colors are linear/,
  'source.ply': /^60 splats classic$/,
  'source0.ply': /^60 splats classic$/,
  'spz-gsbox-4.8.4.spz': /^3 splats classic assumed The file does not name its axes, .*set up="y"\.$/,
  'spz-niantic-ply_to_spz.spz': /^3 splats classic assumed The file does not name its axes, .*set up="y"\.$/,
  'spz-system-12.spz': /^60 splats classic$/,
  'up-nerfstudio.ply': /^60 splats classic up 0 0 1$/,
};
const SCENE = /\.(ply|glb|gltf|spz|spx|sog|splat|ksplat|lcc|lcc2|usd.?|pt|npz|splatv|zip)$|(^|-)(meta|tileset)\.json$/;

for (const [folder, cases] of [
  ['formats', CASES],
  ['formats-3', LATER_CASES],
] as const) {
  test(`every case of ${folder} is right, or rightly named`, { skip: needsSharedData }, async (context) => {
    const path = sharedPath(`../cases/${folder}`);
    const files = readdirSync(path).filter((file) => SCENE.test(file));
    assert.ok(files.length >= 12, `${files.length} files`);
    for (const file of files) {
      const found = await readScene(readFileSync(`${path}/${file}`), { name: file }).then(describe, (error: unknown) =>
        error instanceof GaussianSplatError ? `${error.code} ${error.message}` : String(error),
      );
      context.diagnostic(`${file}: ${found}`);
      // Later parts must at least be reported.
      assert.match(found, cases[file] ?? /^\d+ splats|decode\/(unsupported|not-splats)/, file);
    }
  });
}

const describe = ({ count, antialiased, filterVariance, hints, warnings = [] }: GaussianCloud): string =>
  [
    `${count} splats ${antialiased ? (filterVariance ?? 0.3) : 'classic'}`,
    ...(hints?.up ? [`up ${hints.up.join(' ')}`] : []),
    ...(hints?.isUpAssumed ? ['assumed'] : []),
    ...warnings,
  ].join(' ');

test('what tools made of one scene has the numbers of its source', { skip: needsSharedData }, async () => {
  const read = (file: string): Promise<GaussianCloud> =>
    readScene(readFileSync(sharedPath(`../cases/formats-3/${file}`)), { name: file });
  const [source, gltf, right] = await Promise.all(['source.ply', 'source0.ply', 'khr-right.glb'].map(read));
  for (const file of ['khr-log.glb', 'khr-log-mixed.glb', 'khr-logit-only.glb']) {
    const cloud = await read(file);
    assertAtMost(largestDifference(cloud.opacities, gltf.opacities), 1e-6, `${file}, opacities`);
    assertAtMost(largestDifference(cloud.positions, right.positions), 1e-6, `${file}, positions`);
    if (file !== 'khr-log-mixed.glb')
      assertAtMost(largestDifference(cloud.scales, gltf.scales), 1e-6, `${file}, scales`);
  }
  // gsbox sorts splats.
  const gsbox = await read('glb-gsbox-4.8.4.glb');
  const byPlace = (cloud: GaussianCloud): number[] =>
    Array.from({ length: 60 }, (_, i) => i).sort((a, b) => cloud.positions[3 * a] - cloud.positions[3 * b]);
  const [mine, others] = [byPlace(source), byPlace(gsbox)];
  mine.forEach((i, n) => {
    const j = others[n];
    assertAtMost(Math.abs(source.opacities[i] - gsbox.opacities[j]), 1 / 255, 'opacity by gsbox');
    for (let k = 0; k < 3; k++) {
      assertAtMost(Math.abs(source.positions[3 * i + k] - gsbox.positions[3 * j + k]), 1e-6, 'position by gsbox');
      assertAtMost(Math.abs(source.scales[3 * i + k] - gsbox.scales[3 * j + k]), 1e-6, 'scale by gsbox');
    }
  });
  const turned = await read('spz-system-12.spz');
  assertAtMost(largestDifference(turned.positions, source.positions), 1.3e-4, 'positions of system 12');
  assertAtMost(largestDifference(turned.sh, source.sh), 0.1, 'harmonics of system 12');
});
