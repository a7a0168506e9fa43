import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { readScene, splatRanges } from '@gaussian-splat/formats';
import { shBasis } from '../oracle/sh.js';
import { onlyInLab } from '../support/extent.js';
import { seededRandom } from '../support/random.js';
import { assertAtMost, assertSameCloud, expectRefusal, largestDifference } from './support/expect.js';
import { buildGltf, withMeshopt, writeGlb } from './support/gltf-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { rawSplats } from './support/splats.js';
import { halfTurned, needsSharedData, sharedFile } from '../support/data.js';
import { writeSpz } from './support/spz-writer.js';

const read = (...[meshes, nodes, roots]: Parameters<typeof buildGltf>): Promise<GaussianCloud> => {
  const { json, buffer } = buildGltf(meshes, nodes, roots);
  return readScene(writeGlb(json, buffer), { name: 'a.glb' });
};

/** Covariance of a splat, [3, 3]. */
function covariance({ rotations, scales }: GaussianCloud, i: number): number[] {
  const [w, x, y, z] = rotations.subarray(4 * i, 4 * i + 4);
  const r = [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
  return Array.from({ length: 9 }, (_, k) => {
    const [a, b] = [Math.floor(k / 3), k % 3];
    return [0, 1, 2].reduce((sum, axis) => sum + r[3 * a + axis] * r[3 * b + axis] * scales[3 * i + axis] ** 2, 0);
  });
}

const transform = (m: readonly number[], s: readonly number[]): number[] => {
  const product = (a: readonly number[], b: readonly number[], f = (r: number, c: number) => b[3 * r + c]): number[] =>
    Array.from({ length: 9 }, (_, k) =>
      [0, 1, 2].reduce((sum, j) => sum + a[3 * Math.floor(k / 3) + j] * f(j, k % 3), 0),
    );
  return product(product(m, s), m, (row, column) => m[3 * column + row]);
};

/** Color of a splat in a direction, before 0.5 is added. */
const color = ({ sh, shDegree }: GaussianCloud, i: number, direction: Vector3): number[] => {
  const basis = shBasis(shDegree, direction);
  return [0, 1, 2].map((c) => basis.reduce((sum, y, k) => sum + y * sh[3 * basis.length * i + 3 * k + c], 0));
};

const FLIP = [-1, 0, 0, 0, -1, 0, 0, 0, 1];

test('without transforms: right, down and forward', async () => {
  const cloud = smallCloud(20, 3);
  const found = await read([[{ cloud }]], [{ mesh: 0 }], [0]);
  const turned = cloud.positions.map((value, k) => (k % 3 === 2 ? value : -value));
  assertAtMost(largestDifference(found.positions, turned), 0, 'positions');
  assert.deepEqual([found.shDegree, found.count], [3, 20]);
});

for (const [what, node, linear] of [
  ['turned and scaled alike', { rotation: [0.1, 0.7, -0.2, 0.678232998], scale: [1.7, 1.7, 1.7] }, undefined],
  ['mirrored', { scale: [-1, 1, 1] }, [-1, 0, 0, 0, 1, 0, 0, 0, 1]],
  ['stretched', { scale: [3, 1, 0.5] }, [3, 0, 0, 0, 1, 0, 0, 0, 0.5]],
  ['flattened', { scale: [1, 2, 0] }, [1, 0, 0, 0, 2, 0, 0, 0, 0]],
  ['flattened askew', { matrix: [1, 1, 0, 0, 0, 0, 2, 0, 2, 2, 2, 0, 0, 0, 0, 1] }, [1, 0, 2, 1, 0, 2, 0, 2, 2]],
  ['sheared', { matrix: [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0.2, 2, 0, 4, 5, 6, 1] }, [1, 0.5, 0, 0, 1, 0.2, 0, 0, 2]],
] as const) {
  test(`a node that is ${what} moves covariances and turns colors`, async () => {
    const cloud = smallCloud(12, 3, 5);
    const found = await read([[{ cloud }]], [{ children: [1] }, { mesh: 0, ...node }], [0]);
    const keepsShapes = what === 'turned and scaled alike' || what === 'mirrored';
    assert.equal(found.count, 12);
    const m = linear ?? rotationTimes(node.rotation, 1.7);
    const toCloud = Array.from({ length: 9 }, (_, k) => FLIP[4 * Math.floor(k / 3)] * m[k]);
    const random = seededRandom(9);
    for (let i = 0; i < cloud.count; i++) {
      assertAtMost(
        largestDifference(covariance(found, i), transform(toCloud, covariance(cloud, i))),
        3e-6,
        'covariance',
      );
      if (!keepsShapes) continue;
      // The color in a turned direction equals the color in the original one.
      const d = random.direction();
      const size = Math.cbrt(Math.abs(determinant(toCloud)));
      const turned = [0, 1, 2].map((r) => [0, 1, 2].reduce((sum, k) => sum + (toCloud[3 * r + k] * d[k]) / size, 0));
      assertAtMost(largestDifference(color(found, i, turned as unknown as Vector3), color(cloud, i, d)), 1e-5, 'color');
    }
  });
}

test('places far from (0, 0, 0) keep their digits', async () => {
  const cloud = smallCloud(9, 1);
  const translation = [4_010_226.25, -735_123.5, 4_887_042.125];
  const nodes = [{ translation, rotation: [0, 0, Math.SQRT1_2, Math.SQRT1_2], children: [1, 2] }, { mesh: 0 }];
  const near = { mesh: 0, translation: [20, 0, 0] };
  const found = await read([[{ cloud }]], [...nodes, near], [0]);
  assert.equal(found.count, 18);
  for (let i = 0; i < 18; i++) {
    const [x, y, z] = cloud.positions.subarray(3 * (i % 9), 3 * (i % 9) + 3);
    const shift = i < 9 ? 0 : 20;
    // A quarter turn about z, the node's place, and then left and up become right and down.
    const expected = [y - translation[0], -(x + shift) - translation[1], z + translation[2]];
    for (let axis = 0; axis < 3; axis++) {
      const world = found.origin[axis] + found.positions[3 * i + axis];
      assertAtMost(Math.abs(world - expected[axis]), 4e-6, `splat ${i}, axis ${axis}`);
    }
  }
  const { json, buffer } = buildGltf([[{ cloud }]], [...nodes, near], [0]);
  assert.equal(await splatRanges(writeGlb(json, buffer), 'a.glb'), undefined);
});

test('a node that leaves a line or a point leaves its splats out, and those of others alone', async () => {
  const cloud = smallCloud(4, 1);
  const nodes = [{ mesh: 0 }, { mesh: 0, scale: [0, 0, 0] }, { mesh: 0, scale: [0, 3, 0] }];
  const found = await read([[{ cloud }]], nodes, [0, 1, 2]);
  assert.deepEqual([found.count, found.droppedCount], [4, 8]);
});

function rotationTimes([x, y, z, w]: readonly number[], scale: number): number[] {
  return [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ].map((value) => scale * value);
}

function determinant(m: readonly number[]): number {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

test('primitives of mixed degree and meshes in several places become one cloud', async () => {
  const [a, b] = [smallCloud(5, 2, 1), smallCloud(7, 0, 2)];
  const nodes = [{ mesh: 0 }, { mesh: 0, translation: [10, 0, 0] }];
  const found = await read([[{ cloud: a }, { cloud: b }]], nodes, [0, 1]);
  assert.deepEqual([found.count, found.shDegree], [24, 2]);
  assert.deepEqual(Array.from(found.sh.subarray(27 * 5 + 3, 27 * 6)), new Array(24).fill(0));
  assertAtMost(Math.abs(found.positions[36] - (found.positions[0] - 10)), 1e-5, 'the second place');
});

test('drafts of the extension: other names, and opacities in the colors', async () => {
  const cloud = smallCloud(7, 0);
  const { json, buffer } = buildGltf([[{ cloud }]], [{ mesh: 0 }], [0]);
  const recent = await readScene(writeGlb(json, buffer), { name: 'a.glb' });
  const rgba = Float32Array.from({ length: 28 }, (_, k) =>
    k % 4 === 3 ? cloud.opacities[k >> 2] : 0.5 + 0.28209479177387814 * cloud.sh[3 * (k >> 2) + (k % 4)],
  );
  const copy = structuredClone(json) as Record<'accessors' | 'bufferViews', object[]> & {
    meshes: { primitives: { attributes: Record<string, number> }[] }[];
  };
  const [primitive] = copy.meshes[0].primitives;
  const { POSITION, ...rest } = primitive.attributes;
  copy.bufferViews.push({ buffer: 0, byteOffset: buffer.length, byteLength: rgba.byteLength });
  const view = copy.bufferViews.length - 1;
  copy.accessors.push({ bufferView: view, componentType: 5126, count: 7, type: 'VEC4' });
  primitive.attributes = {
    POSITION,
    COLOR_0: copy.accessors.length - 1,
    _ROTATION: rest['KHR_gaussian_splatting:ROTATION'],
    _SCALE: rest['KHR_gaussian_splatting:SCALE'],
  };
  const file = writeGlb(copy as Record<string, unknown>, Buffer.concat([buffer, Buffer.from(rgba.buffer)]));
  const draft = await readScene(file, { name: 'a.glb' });
  assertAtMost(largestDifference(draft.sh, recent.sh), 1e-6, 'colors');
  assertSameCloud({ ...draft, sh: recent.sh }, recent);
});

test('SPZ inside is the same scene as the SPZ file', async () => {
  // The extension names the frame, which overrides the writer's convention.
  const spz = writeSpz(rawSplats(9, 1), { version: 2, axes: [1, -1, -1] });
  const found = await read([[{ cloud: smallCloud(1, 0), spz }]], [{ mesh: 0 }], [0]);
  const direct = halfTurned(await readScene(spz, { name: 'a.spz' }));
  assertAtMost(largestDifference(found.positions, direct.positions), 1e-6, 'positions');
  assertAtMost(largestDifference(found.sh, direct.sh), 1e-5, 'colors');
});

test('JSON with a buffer of its own, and with one written as text', async () => {
  const cloud = smallCloud(6, 1);
  const { json, buffer } = buildGltf([[{ cloud }]], [{ mesh: 0 }], [0]);
  const inside = await readScene(writeGlb(json, buffer), { name: 'a.glb' });
  const text = (uri: string): Uint8Array =>
    Buffer.from(JSON.stringify({ ...json, buffers: [{ uri, byteLength: buffer.length }] }));
  const embedded = `data:application/octet-stream;base64,${buffer.toString('base64')}`;
  assertSameCloud(await readScene(text(embedded), { name: 'a.gltf' }), inside);
  const openFile = async (path: string): Promise<Uint8Array> => (assert.equal(path, 'a b.bin'), new Uint8Array(buffer));
  assertSameCloud(await readScene(text('a%20b.bin'), { name: 'a.gltf', openFile }), inside);
  assertSameCloud(await readScene(text('a%20b.bin?v=3#x'), { name: 'a.gltf', openFile }), inside);
  await expectRefusal(text('b.bin'), 'decode/unsupported', /only this one.*, s\/scene\.glb/, { name: 's/a.gltf' });
});

test('a buffer of 50 MB written as text', { skip: onlyInLab }, async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(6, 1) }]], [{ mesh: 0 }], [0]);
  const padded = Buffer.concat([buffer, Buffer.alloc(51e6)]);
  const uri = `data:application/octet-stream;base64,${padded.toString('base64')}`;
  const file = Buffer.from(JSON.stringify({ ...json, buffers: [{ uri, byteLength: padded.length }] }));
  assertSameCloud(await readScene(file, { name: 'a' }), await readScene(writeGlb(json, buffer), { name: 'a' }));
});

test('JSON is recognized as glTF in any order of its keys', async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(400, 3) }]], [{ mesh: 0 }], [0]);
  const inside = await readScene(writeGlb(json, buffer), { name: 'a' });
  const { asset, buffers, ...rest } = json;
  const uri = `data:application/octet-stream;base64,${buffer.toString('base64')}`;
  const embedded = { buffers: [{ ...(buffers as object[])[0], uri }] };
  assert.ok(uri.length > 65_536);
  for (const file of [
    { ...embedded, ...rest, asset },
    { ...rest, ...embedded, asset: { extras: { author: {} }, version: '2.0' } },
  ]) {
    const text = JSON.stringify(file);
    assertSameCloud(await readScene(Buffer.from(text), { name: 'a' }), inside);
    assertSameCloud(await readScene(Buffer.from(`\ufeff\n${text}\n`), { name: 'a' }), inside);
  }
});

test('copies are bounded, and what is in the file once is not', { skip: onlyInLab }, async () => {
  // 1.1 MB, which may take 355 MB of memory, and 20,000 splats of 56 bytes: 60 copies are given, 2,000 would be 2 GiB.
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(20_000, 0) }]], [{ mesh: 0 }], [0]);
  const shown = (times: number): Uint8Array =>
    writeGlb({ ...json, nodes: [{ children: new Array(times).fill(1) }, { mesh: 0 }] }, buffer);
  assert.equal((await readScene(shown(60), { name: 'a.glb' })).count, 1_200_000);
  await expectRefusal(shown(2_000), 'out-of-memory/budget', /at most 355,\d+,\d+ bytes of memory/, { name: 'a.glb' });
  // Two lines of JSON, and all splats in a file of their own.
  const count = 2_900_000;
  const view = { buffer: 0, byteOffset: 0, byteLength: 16 * count };
  const accessor = { bufferView: 0, byteOffset: 0, componentType: 5126, count };
  const [POSITION, SCALE, ROTATION, OPACITY] = [0, 0, 1, 2];
  const own = { SCALE, ROTATION, OPACITY, SH_DEGREE_0_COEF_0: 0 };
  const attributes = Object.fromEntries(Object.entries(own).map(([k, v]) => [`KHR_gaussian_splatting:${k}`, v]));
  const large = {
    asset: { version: '2.0' },
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION, ...attributes }, extensions: { KHR_gaussian_splatting: {} } }] }],
    accessors: ['VEC3', 'VEC4', 'SCALAR'].map((type) => ({ ...accessor, type })),
    bufferViews: [view],
    buffers: [{ uri: 'a.bin', byteLength: view.byteLength }],
  };
  const file = Buffer.from(JSON.stringify(large));
  assert.ok(count > 4_096 * file.length, `${file.length} bytes`);
  const openFile = async (): Promise<Uint8Array> => new Uint8Array(new Float32Array(4 * count).fill(0.5).buffer);
  assert.equal((await readScene(file, { name: 'a.gltf', openFile })).count, count);
});

test('splats whose buffer views meshoptimizer has compressed are those of the plain file', async () => {
  for (const extension of ['EXT_meshopt_compression', 'KHR_meshopt_compression']) {
    const { json, buffer } = buildGltf([[{ cloud: smallCloud(300, 3) }], [{ cloud: smallCloud(9, 0) }]], [{ mesh: 0 }, { mesh: 1 }], [0, 1]); // prettier-ignore
    const packed = await withMeshopt(json, buffer, extension);
    const file = writeGlb(packed.json, packed.buffer);
    const cloud = await readScene(file, { name: 'a.glb' });
    assertSameCloud(cloud, await readScene(writeGlb(json, buffer), { name: 'a.glb' }));
    assert.equal(cloud.warnings, undefined);
    assert.equal(await splatRanges(file, 'a.glb'), undefined, 'compressed views cannot be read in ranges');
    const views = packed.json.bufferViews as { extensions: Record<string, object> }[];
    const broken = (change: object): Uint8Array => {
      const bufferViews = views.map((view, k) =>
        k === 1 ? { ...view, extensions: { [extension]: { ...view.extensions[extension], ...change } } } : view,
      );
      return writeGlb({ ...packed.json, bufferViews }, packed.buffer);
    };
    for (const [change, code, message] of [
      [
        { byteLength: 5 },
        'decode/corrupt',
        /bufferViews\[1\]: expected 300 elements of 12 bytes, compressed by meshop/,
      ],
      [{ mode: 'NEW' }, 'decode/header', /bufferViews\[1\]: expected a mode and a filter of meshopt/],
      [{ byteStride: 300 }, 'decode/header', /a count and a stride of meshopt/],
      [{ count: 1e9 }, 'out-of-memory/budget', /bytes of memory/],
      [{ byteLength: 1e9 }, 'decode/truncated', /bufferViews\[1\]/],
    ] as const)
      await expectRefusal(broken(change), code, message, { name: 'a.glb' });
  }
});

test('a conversion of another tool with meshopt is read', { skip: needsSharedData }, async () => {
  const [plain, packed] = await Promise.all(
    ['khr-plain.glb', 'khr-ext-meshopt.glb'].map((name) =>
      readScene(sharedFile(`../cases/mission-4/${name}`), { name }),
    ),
  );
  assertSameCloud(packed, plain);
});

test('what the extension allows and we do not draw falls back with a warning, or is refused by name', async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(2, 0) }]], [{ mesh: 0 }], [0]);
  type Splats = { extensions: { KHR_gaussian_splatting: Record<string, unknown> } };
  const changed = (change: (splats: Splats['extensions']['KHR_gaussian_splatting']) => void): Uint8Array => {
    const copy = structuredClone(json) as { meshes: { primitives: Splats[] }[] };
    change(copy.meshes[0].primitives[0].extensions.KHR_gaussian_splatting);
    return writeGlb(copy as Record<string, unknown>, buffer);
  };
  for (const [property, value] of [
    ['kernel', 'customShape'],
    ['colorSpace', 'aces'],
    ['sortingMethod', 'byPixel'],
    ['projection', 'spherical'],
  ]) {
    const unknown = await readScene(
      changed((splats) => (splats[property] = value)),
      { name: 'a.glb' },
    );
    assert.deepEqual([unknown.count, unknown.warnings?.length], [2, 1]);
    assert.match(unknown.warnings![0], new RegExp(`${property} "${value}"`));
  }
  const nested = changed((splats) => Object.assign(splats, { kernel: 'cone', extensions: { EXT_kernel_cone: {} } }));
  const asEllipses = await readScene(nested, { name: 'a.glb' });
  assertSameCloud({ ...asEllipses, warnings: undefined }, await readScene(writeGlb(json, buffer), { name: 'a.glb' }));
  assert.deepEqual(asEllipses.warnings, ['The kernel "cone" of splats is not known; "ellipse" is drawn in its place.']);
  // An extension without plain attributes is a compression, whose splats cannot be read.
  const packed = structuredClone(json) as { meshes: { primitives: (Splats & { attributes: object })[] }[] };
  const [primitive] = packed.meshes[0].primitives;
  primitive.extensions.KHR_gaussian_splatting.extensions = { EXT_other: {} };
  primitive.attributes = {};
  const other = writeGlb(packed as unknown as Record<string, unknown>, buffer);
  await expectRefusal(other, 'decode/unsupported', /EXT_other/, { name: 'a.glb' });
  const accessors = json.accessors as { bufferView?: number }[];
  const without = accessors.map(({ bufferView, ...rest }, k) => (k === 3 ? rest : { ...rest, bufferView }));
  const zeros = writeGlb({ ...json, accessors: without }, buffer);
  await expectRefusal(zeros, 'decode/unsupported', /accessors\[3\].*bufferView/, { name: 'a.glb' });
  const sparse = accessors.map((accessor, k) => (k === 3 ? { ...accessor, sparse: {} } : accessor));
  await expectRefusal(writeGlb({ ...json, accessors: sparse }, buffer), 'decode/header', /sparse/, { name: 'a' });
  for (const required of ['EXT_mesh_gpu_instancing', 'ACME_warp', 7]) {
    const file = writeGlb({ ...json, extensionsRequired: ['KHR_gaussian_splatting', required] }, buffer);
    await expectRefusal(file, 'decode/unsupported', new RegExp(`extensionsRequired.*${required}`), { name: 'a.glb' });
  }
  const harmless = [
    ...['KHR_gaussian_splatting', 'KHR_gaussian_splatting_compression_spz_2', 'KHR_mesh_quantization'],
    ...['EXT_meshopt_compression', 'KHR_meshopt_compression'],
    ...['KHR_materials_unlit', 'KHR_texture_basisu', 'EXT_texture_webp', 'KHR_lights_punctual', 'EXT_mesh_features'],
  ];
  const inside = await readScene(writeGlb({ ...json, extensionsRequired: harmless }, buffer), { name: 'a.glb' });
  assert.equal(inside.count, 2);
  const loop = writeGlb({ ...json, nodes: [{ children: [0] }] }, buffer);
  await expectRefusal(loop, 'decode/header', /nodes that contain themselves/, { name: 'a.glb' });
  const { meshes } = json as { meshes: { primitives: object[] }[] };
  const primitives = Array.from({ length: 2000 }, () => meshes[0].primitives[0]);
  const nodes = [{ children: Array.from({ length: 9000 }, () => 1) }, { mesh: 0 }];
  const repeated = writeGlb({ ...json, nodes, meshes: [{ primitives }] }, buffer);
  await expectRefusal(repeated, 'out-of-memory/budget', /bytes of memory for 588,908/, { name: 'a.glb' });
  const copies = Array.from({ length: 9000 }, () => ({ mesh: 0 }));
  assert.equal(
    (
      await readScene(writeGlb({ ...json, nodes: copies, scenes: [{ nodes: copies.map((_, k) => k) }] }, buffer), {
        name: 'a',
      })
    ).count,
    18_000,
  );
});
