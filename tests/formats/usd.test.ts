/** OpenUSD without usd-core: files of other tools, files of `optimize`, and hostile ones. usd-core.alone.test.ts compares with usd-core. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { zipSync } from 'fflate';
import { halfToNumber, numberToHalf, type GaussianCloud } from '@gaussian-splat/core';
import { encodingsFor } from '@gaussian-splat/optimize';
import { detectFormat, readScene, uprightRotation, turned } from '@gaussian-splat/formats';
import { needsSharedData, sharedFile } from '../support/data.js';
import {
  assertAtMost,
  assertHelpful,
  assertSameCloud,
  assertSameNumbers,
  CUT_STEP,
  expectRefusal,
  largestDifference,
  largestRotationError,
  refusalOf,
} from './support/expect.js';
import { smallCloud } from './support/small-cloud.js';

const fixture = (name: string): Uint8Array =>
  readFileSync(new URL(`../fixtures/usd/${name}`, import.meta.url).pathname);
const text = (content: string): Uint8Array => new TextEncoder().encode(content);
const read = (file: Uint8Array, name = 'a.usda'): Promise<GaussianCloud> => readScene(file, { name });

const TWO = `
    point3f[] positions = [(1, 2, 3), (4, 5, 6)]
    float3[] scales = [(0.1, 0.1, 0.1), (0.2, 0.2, 0.2)]`;
/** A stage with one prim of two splats, more content of this prim, its metadata, and more prims. */
const stage = (own = '', metadata = '', more = ''): Uint8Array =>
  text(
    `#usda 1.0\n(\n    upAxis = "Y"\n)\ndef ParticleField3DGaussianSplat "S" (${metadata})\n{${TWO}\n${own}\n}\n${more}`,
  );

test('a conversion of a PLY by another tool has its numbers', { skip: needsSharedData }, async () => {
  const source = await readScene(sharedFile('../cases/mission-4/source.ply'));
  for (const name of ['splats.usda', 'splats.usdz']) {
    const cloud = await readScene(sharedFile(`../cases/mission-4/${name}`), { name });
    for (const key of ['positions', 'scales', 'opacities', 'sh'] as const)
      assertAtMost(largestDifference(cloud[key], source[key]), 1e-6, `${name}, ${key}`);
    assertAtMost(largestRotationError(cloud, source), 1e-6, `${name}, rotations`);
    assert.deepEqual(cloud.hints, { up: [0, 1, 0], metersPerUnit: 1 });
  }
});

test('text and binary layers of one stage are the same cloud, at the first frame', async () => {
  const [asText, asBinary] = await Promise.all(['scene.usda', 'scene.usdc'].map((name) => read(fixture(name), name)));
  assertSameCloud(asBinary, asText);
  assert.deepEqual([asText.count, asText.shDegree], [38, 1]);
  assert.deepEqual(asText.hints, { order: 'pixel', up: [0, 0, 1], metersPerUnit: 0.01 });
  assert.deepEqual(asText.warnings, [
    'Time samples of 1 prims are left out: the first frame is drawn without motion.',
    '1 meshes of the stage are left out.',
  ]);
  assert.equal(detectFormat(fixture('scene.usdc')), 'usd');
  const packed = zipSync({ 'scene.usdc': fixture('scene.usdc'), 'x/scene.ply': text('ply') }, { level: 0 });
  assertSameCloud(await read(packed, 'a.usdz'), asText);
});

test('composition is refused by name where it may change splats, and a warning elsewhere', async () => {
  const arcs: readonly [metadata: string, name: RegExp][] = [
    ['references = @./other.usda@</X>', /references/],
    ['prepend references = [@a.usda@</X> (offset = 1), @b.usda@]', /references/],
    ['payload = @a.usdc@', /payloads/],
    ['inherits = </_class>', /inherits/],
    ['add specializes = [</A>, </B>]', /specializes/],
    ['prepend variantSets = "look"', /variant sets/],
    ['clips = {\n dictionary default = { asset[] assetPaths = [@a.usd@] }\n}', /value clips/],
  ];
  for (const [metadata, name] of arcs) {
    const error = await expectRefusal(stage('', metadata), 'decode/unsupported', name, { name: 'a.usda' });
    assert.match(error.message, /a\.usda, \/S.*usdcat --flatten/);
    const alone = text(`#usda 1.0\ndef Xform "X" (${metadata}) {}`);
    await expectRefusal(alone, 'decode/unsupported', name, { name: 'a.usda' });
    const { count, warnings } = await read(stage('', '', `def Xform "Lights" (${metadata}) {}`));
    assert.equal(count, 2);
    assert.match(warnings!.join(), new RegExp(`${name.source} of /Lights`));
  }
  const layered = text('#usda 1.0\n(\n subLayers = [@a.usda@]\n)\ndef ParticleField3DGaussianSplat "S" {\n}');
  await expectRefusal(layered, 'decode/unsupported', /sublayers/, { name: 'a.usda' });
  const variants = 'variantSet "look" = {\n "a" {\n def Xform "K" {\n }\n }\n}';
  await expectRefusal(stage(variants), 'decode/unsupported', /variant sets/, { name: 'a.usda' });
  for (const none of ['references = None', 'payload = []', 'delete references = @a.usda@', '"a comment: ) {"'])
    assert.equal((await read(stage('', none))).warnings, undefined, none);
});

test('a stage without splats is named with what it has', async () => {
  const meshes = text('#usda 1.0\ndef Mesh "A" {\n}\ndef Mesh "B" {\n}\ndef Camera "C" {\n}');
  await expectRefusal(meshes, 'decode/not-splats', /found 2 Mesh, 1 Camera/, { name: 'a.usda' });
  const field = text('#usda 1.0\ndef ParticleField "A" {\n}');
  await expectRefusal(field, 'decode/not-splats', /without a kernel of Gaussians/, { name: 'a.usda' });
  await expectRefusal(stage('token visibility = "invisible"'), 'decode/not-splats', /no prims/, { name: 'a.usda' });
  await expectRefusal(stage('', 'active = false'), 'decode/not-splats', /no prims/, { name: 'a.usda' });
  assert.equal((await read(stage('uniform token purpose = "render"'))).count, 2);
});

test('arrays that are too short or missing have the defaults of OpenUSD', async () => {
  const short = await read(stage('float[] opacities = [0.5]\nuniform int radiance:sphericalHarmonicsDegree = 0'));
  assert.deepEqual([...short.opacities], [1, 1]);
  assert.deepEqual([...short.rotations], [1, 0, 0, 0, 1, 0, 0, 0]);
  assert.deepEqual([...short.sh], [0, 0, 0, 0, 0, 0]);
  assert.deepEqual(short.warnings, ['/S: opacities has values for 1 of 2 splats, and is ignored, as OpenUSD demands.']);
  const long = await read(stage('half[] opacitiesh = [0.5, 0.1, 1, 1]'));
  assert.deepEqual([...long.opacities], [0.5, halfToNumber(numberToHalf(0.1))]);
});

test('hints of order and projection', async () => {
  for (const [hint, order] of [
    ['zDepth', undefined],
    ['cameraDistance', 'distance'],
    ['rayHitDistance', 'pixel'],
  ] as const) {
    const own = `uniform token sortingModeHint = "${hint}"`;
    const cloud = await read(stage(own));
    assert.equal(cloud.hints?.order, order);
    for (const ext of ['usdz', 'ply', 'spz', 'glb']) {
      const [encoding] = encodingsFor(`a.${ext}`).slice(-1);
      const degrees = new Uint8Array(cloud.count).fill(cloud.shDegree);
      const again = await readScene(await encoding.write({ cloud, degrees }), { name: `a.${ext}` });
      assert.equal(again.hints?.order, order, `${hint} in ${ext}`);
    }
  }
  const { warnings } = await read(stage('uniform token projectionModeHint = "tangential"'));
  assert.match(warnings!.join(), /projectionModeHint "tangential" of \/S is not known/);
});

test('flat kernels are discs, and say so', async () => {
  const schemas = 'prepend apiSchemas = ["ParticleFieldPositionAttributeAPI", "ParticleFieldKernelGaussianSurfletAPI"]';
  const flat = await read(text(`#usda 1.0\ndef ParticleField "S" (${schemas})\n{${TWO}\n}`));
  assert.deepEqual(
    [...flat.scales].filter((_, k) => k % 3 === 2),
    [0, 0],
  );
  assert.match(flat.warnings!.join(), /2DGS/);
  assert.equal(flat.hints?.isUpAssumed, true, 'the layer has no upAxis');
  assert.match(flat.warnings!.join(), /does not name its up axis, and y is assumed.*up="z"/);
});

const written = async (name: string, cloud: GaussianCloud): Promise<Uint8Array[]> => {
  const degrees = new Uint8Array(cloud.count).fill(cloud.shDegree);
  return Promise.all(encodingsFor(name).map(async (encoding) => encoding.write({ cloud, degrees })));
};

test('a written scene returns as it was, in every direction up', async () => {
  for (const degree of [0, 1, 2, 3] as const) {
    const cloud = smallCloud(40, degree);
    for (const up of [undefined, [0, 1, 0], [0, 0, 1]] as const) {
      const given = { ...cloud, hints: { up, metersPerUnit: 0.25 } };
      for (const name of ['a.usdz', 'a.usdc']) {
        const [halves, floats] = await written(name, structuredClone(given));
        const [found, rough] = await Promise.all([read(floats, name), read(halves, name)]);
        assert.deepEqual(found.hints, { up: up ?? [0, 1, 0], metersPerUnit: 0.25 });
        assert.ok(halves.length < floats.length, `${halves.length} and ${floats.length} bytes`);
        // Turned to the same direction up, without any rounding.
        const [ours, theirs] = [given, found].map((one) => {
          const turn = uprightRotation(one);
          return turn ? turned(one, turn) : one;
        });
        for (const key of ['positions', 'scales', 'opacities', 'sh'] as const)
          assertSameNumbers(theirs[key].map((x) => x + 0), ours[key].map((x) => x + 0), `${name}, ${key}`); // prettier-ignore
        assertAtMost(largestRotationError(theirs, ours), 2e-7, 'rotations');
        assertSameNumbers(rough.positions, found.positions, 'positions beside float16');
        for (const key of ['scales', 'rotations', 'opacities', 'sh'] as const)
          assertAtMost(largestDifference(rough[key], found[key]), 1e-3, `${name}, ${key} in float16`);
      }
    }
  }
});

test('far scenes keep their origin, and files of a USDZ are at multiples of 64 bytes', async () => {
  const far = { ...smallCloud(10, 0), origin: [4_000_000.125, -5_000_000.5, 300] as const };
  const [, file] = await written('a.usdz', far);
  const view = new DataView(file.buffer);
  assert.equal((30 + view.getUint16(26, true) + view.getUint16(28, true)) % 64, 0);
  const found = await read(file, 'a.usdz');
  for (let k = 0; k < 30; k++) {
    const sign = k % 3 === 0 ? 1 : -1;
    const [x, y] = [far.origin[k % 3] + far.positions[k], sign * (found.origin[k % 3] + found.positions[k])];
    assertAtMost(Math.abs(x - y), 1e-6, `coordinate ${k}`);
  }
  assert.throws(() => encodingsFor('a.usdz', { antialiased: true }), /\.sog, \.spz, \.ply/);
});

const FILES: Readonly<Record<string, Uint8Array>> = {
  'scene.usda': fixture('scene.usda').subarray(0, Buffer.from(fixture('scene.usda')).lastIndexOf('}') + 1),
  'scene.usdc': fixture('scene.usdc'),
};
for (const [name, file] of Object.entries(FILES)) {
  test(`${name}, cut anywhere, is refused by name`, async () => {
    for (let length = 0; length < file.length; length += CUT_STEP) {
      const error = await refusalOf(file.subarray(0, length), { name });
      // Text ends between two prims at the root.
      if (!error && name === 'scene.usda' && file[length - 1] !== undefined) {
        assert.match(Buffer.from(file.subarray(0, length)).toString(), /\n}\s*$/);
        continue;
      }
      assert.ok(error, `${length} of ${file.length} bytes were read`);
      assertHelpful(error, name);
      assert.match(error.code, /^decode\/(truncated|unknown-format|empty|corrupt|not-splats)$/, error.message);
    }
  });
}

test('hostile text ends soon, by name', async () => {
  const field = 'def ParticleField3DGaussianSplat "S"\n{\n';
  const deep = `#usda 1.0\n${'def Xform "A" {\n'.repeat(100_000)}`;
  await expectRefusal(text(deep), 'decode/corrupt', /at most 500 deep/, { name: 'a.usda' });
  const brackets = `#usda 1.0\n(\n a = ${'['.repeat(1_000_000)}`;
  await expectRefusal(text(brackets), 'decode/truncated', /end of the file/, { name: 'a.usda' });
  const words = `#usda 1.0\n${field}point3f[] positions = [${'x '.repeat(100)}]\n}`;
  await expectRefusal(text(words), 'decode/corrupt', /"\}"|brackets|numbers/, { name: 'a.usda' });
  const wrong = `#usda 1.0\n${field}point3f[] positions = [1, 2, x]\n}`;
  await expectRefusal(text(wrong), 'decode/corrupt', /numbers in an array, found "x"/, { name: 'a.usda' });
  const quotes = `#usda 1.0\n(\n ${'"'.repeat(999_999)}`;
  assert.ok(await refusalOf(text(quotes), { name: 'a.usda' }));
  const names = `#usda 1.0\n${field}${Array.from({ length: 200_000 }, (_, k) => `int a${k} = ${k}`).join('\n')}\n}`;
  await expectRefusal(text(names), 'decode/empty', /0 splats/, { name: 'a.usda' });
  await expectRefusal(stage('double4 xformOp:warp = (1, 2, 3, 4)\nuniform token[] xformOpOrder = ["xformOp:warp"]'), 'decode/unsupported', /xformOp:warp/, { name: 'a.usda' }); // prettier-ignore
});
