/** glTF that is legal and seldom: layouts of buffers that only some writers make. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { strToU8 } from 'fflate';
import { readScene, splatRanges } from '@gaussian-splat/formats';
import { assertAtMost, assertSameCloud, expectRefusal, largestDifference } from './support/expect.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';
import { smallCloud } from './support/small-cloud.js';

type Json = Record<string, unknown>;
interface Accessor extends Json {
  readonly bufferView: number;
  readonly type: string;
  readonly componentType: number;
}
interface View {
  readonly byteOffset: number;
  readonly byteLength: number;
}

const COUNT = 9;
const cloud = smallCloud(COUNT, 1);
const { json, buffer } = buildGltf([[{ cloud }]], [{ mesh: 0 }], [0]);
const accessors = json.accessors as Accessor[];
const views = json.bufferViews as View[];
const widthOf = ({ type }: Accessor): number => ({ SCALAR: 1, VEC3: 3, VEC4: 4 })[type]!;
const [primitive] = (json.meshes as [{ primitives: [{ attributes: Record<string, number> }] }])[0].primitives;

const options = (bytes: Uint8Array) => ({ name: 'a.gltf', openFile: async () => bytes });
const file = (changed: Json, bytes: Uint8Array, buffers: Json = { uri: 'a.bin' }): Uint8Array =>
  strToU8(JSON.stringify({ ...json, buffers: [{ byteLength: bytes.length, ...buffers }], ...changed }));
const read = (changed: Json, bytes: Uint8Array) => readScene(file(changed, bytes), options(bytes));
const direct = await read({}, buffer);

test('attributes that lie element by element', async () => {
  const stride = 4 * accessors.reduce((sum, accessor) => sum + widthOf(accessor), 0);
  const bytes = Buffer.alloc(8 + COUNT * stride);
  let byteOffset = 0;
  const moved = accessors.map((accessor) => {
    const [from, size] = [views[accessor.bufferView].byteOffset, 4 * widthOf(accessor)];
    for (let i = 0; i < COUNT; i++)
      buffer.copy(bytes, 8 + i * stride + byteOffset, from + i * size, from + (i + 1) * size);
    byteOffset += size;
    return { ...accessor, bufferView: 0, byteOffset: byteOffset - size };
  });
  const view = { buffer: 0, byteOffset: 8, byteLength: COUNT * stride, byteStride: stride };
  assertSameCloud(await read({ accessors: moved, bufferViews: [view] }, bytes), direct);
});

test('normalized integers', async () => {
  const rotation = primitive.attributes['KHR_gaussian_splatting:ROTATION'];
  const opacity = primitive.attributes['KHR_gaussian_splatting:OPACITY'];
  const floats = (k: number): Float32Array => {
    const { byteOffset, byteLength } = views[accessors[k].bufferView];
    return new Float32Array(Uint8Array.from(buffer.subarray(byteOffset, byteOffset + byteLength)).buffer);
  };
  const [shorts, bytes] = [
    new Uint8Array(Int16Array.from(floats(rotation), (value) => Math.round(32_767 * value)).buffer),
    Uint8Array.from(floats(opacity), (value) => Math.round(255 * value)),
  ];
  const all = Buffer.concat([buffer, shorts, bytes]);
  const at = views.length;
  const packed = accessors.map((accessor, k) => {
    if (k === rotation) return { ...accessor, bufferView: at, componentType: 5122, normalized: true };
    return k === opacity ? { ...accessor, bufferView: at + 1, componentType: 5121, normalized: true } : accessor;
  });
  const bufferViews = [
    ...views,
    { buffer: 0, byteOffset: buffer.length, byteLength: shorts.length },
    { buffer: 0, byteOffset: buffer.length + shorts.length, byteLength: bytes.length },
  ];
  const found = await read({ accessors: packed, bufferViews }, all);
  assertAtMost(largestDifference(found.rotations, direct.rotations), 1e-4, 'rotations');
  assertAtMost(largestDifference(found.opacities, direct.opacities), 0.5 / 255 + 1e-6, 'opacities');
});

/** Numbers of one accessor that stand in place of those of its view, or of zeros. */
function sparse(
  k: number,
  at: readonly number[],
  numbers: Float32Array,
  indexType: 5121 | 5123 | 5125,
  zeros: boolean,
) {
  const Indices = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array }[indexType];
  const indices = new Uint8Array(Indices.from(at).buffer);
  const bytes = Buffer.concat([
    buffer,
    Buffer.alloc(4),
    indices,
    Buffer.alloc(-indices.length & 3),
    new Uint8Array(numbers.buffer),
  ]);
  const changed = accessors.map((accessor, n) => {
    if (n !== k) return accessor;
    const { bufferView, ...rest } = accessor;
    const values = { bufferView: views.length + 1, byteOffset: 0 };
    const own = {
      count: at.length,
      indices: { bufferView: views.length, byteOffset: 4, componentType: indexType },
      values,
    };
    return { ...rest, ...(zeros ? {} : { bufferView }), sparse: own };
  });
  const bufferViews = [
    ...views,
    { buffer: 0, byteOffset: buffer.length, byteLength: 4 + indices.length },
    { buffer: 0, byteOffset: bytes.length - 4 * numbers.length, byteLength: 4 * numbers.length },
  ];
  return { changed: { accessors: changed, bufferViews }, bytes };
}

test('sparse accessors, over numbers and over zeros', async () => {
  const at = [1, 4, 8];
  const numbers = Float32Array.from({ length: 9 }, (_, k) => k + 1);
  const color = primitive.attributes['KHR_gaussian_splatting:SH_DEGREE_0_COEF_0'];
  for (const indexType of [5121, 5123, 5125] as const) {
    for (const zeros of [false, true]) {
      const { changed, bytes } = sparse(color, at, numbers, indexType, zeros);
      const { sh, positions } = await read(changed, bytes);
      const expected = direct.sh.slice();
      for (let i = 0; i < COUNT; i++) {
        const own = at.indexOf(i);
        for (let c = 0; c < 3; c++) {
          if (own >= 0) expected[12 * i + c] = numbers[3 * own + c];
          else if (zeros) expected[12 * i + c] = 0;
        }
      }
      assert.equal(largestDifference(sh, expected), 0, `${indexType} over ${zeros ? 'zeros' : 'numbers'}`);
      assert.equal(largestDifference(positions, direct.positions), 0);
    }
  }
  const wrong = (indices: readonly number[], zeros: boolean, k = color) => sparse(k, indices, numbers, 5125, zeros);
  const beyond = wrong([1, 4, 9], false);
  await expectRefusal(file(beyond.changed, beyond.bytes), 'decode/corrupt', /sparse.*9/, options(beyond.bytes));
  // Places must be in the file: they bound the allocation.
  const nowhere = wrong(at, true, primitive.attributes.POSITION);
  await expectRefusal(file(nowhere.changed, nowhere.bytes), 'decode/unsupported', /bufferView/, options(nowhere.bytes));
  const short = wrong(at, false);
  short.changed.bufferViews[views.length + 1] = { buffer: 0, byteOffset: 0, byteLength: 35 };
  await expectRefusal(
    file(short.changed, short.bytes),
    'decode/corrupt',
    /sparse.*36 bytes, found 35/,
    options(short.bytes),
  );
});

test('a scene whose numbers lie in another file cannot be read in parts', async () => {
  assert.equal(await splatRanges(file({}, buffer), 'a.gltf'), undefined);
  const uri = `data:application/octet-stream;base64,${buffer.toString('base64')}`;
  assert.equal((await splatRanges(file({}, buffer, { uri }), 'a.gltf'))?.count, COUNT);
});

test('splats of scenes that are not the default one are not shown, and where there are no others that is said', async () => {
  const scenes = [{ nodes: [] }, { nodes: [0] }];
  assertSameCloud(await read({ scenes, scene: 1 }, buffer), direct);
  for (const scene of [0, undefined]) {
    const message = /1 primitive of splats that the scene does not show.*"scene"/;
    await expectRefusal(file({ scenes, scene }, buffer), 'decode/not-splats', message, options(buffer));
  }
});

test('a buffer on another server is refused by name, not looked for beside the scene', async () => {
  for (const uri of ['https://x.test/a.bin', '//x.test/a.bin', 'blob:https://x.test/1-2', 'C:\\\\a.bin']) {
    const elsewhere = file({}, buffer, { uri });
    await expectRefusal(
      elsewhere,
      'decode/unsupported',
      /buffers\[0\]\.uri: expected .*beside the scene/,
      options(buffer),
    );
  }
});

test('data: in capitals is an address of that kind, and what a primitive lacks is named', async () => {
  const uri = `DATA:application/octet-stream;BASE64,${buffer.toString('base64')}`;
  assertSameCloud(await readScene(file({}, buffer, { uri }), { name: 'a.gltf' }), direct);
  const meshes = [{ primitives: [{ ...primitive, attributes: { COLOR_0: 0 } }] }];
  await expectRefusal(
    file({ meshes }, buffer),
    'decode/header',
    /primitives\[0\], attributes: expected an attribute POSITION, found .*COLOR_0/,
    options(buffer),
  );
  const asset = { version: 'x' };
  await expectRefusal(
    file({ asset }, buffer),
    'decode/unsupported',
    /expected glTF 2\.x, found "x"\./,
    options(buffer),
  );
});

/** World positions of the splats that are left, as a viewer finds them. */
const worldOf = ({ positions, origin }: { positions: Float32Array; origin: readonly number[] }): number[] =>
  Array.from(positions, (value, k) => value + origin[k % 3]);

test('far away, a splat that cannot be drawn takes no other along, and what there is most of keeps its digits', async () => {
  const translation = [4_000_000, 5_000_000, 300];
  const local = smallCloud(9, 0);
  // From left, up and forward to right, down and forward.
  const world = Array.from(local.positions, (value, k) => (k % 3 === 2 ? 1 : -1) * (value + translation[k % 3]));
  const readAt = (clouds: (typeof local)[], nodes: { mesh: number; translation?: number[] }[]) => {
    const built = buildGltf(
      clouds.map((own) => [{ cloud: own }]),
      nodes,
      nodes.map((_, k) => k),
    );
    return readScene(writeGlb(built.json, built.buffer), { name: 'a.glb' });
  };
  for (const value of [1e19, 1e30, -1e17, Infinity, NaN]) {
    const broken = { ...local, positions: local.positions.slice() };
    broken.positions[1] = value;
    const found = await readAt([broken], [{ mesh: 0, translation }]);
    assert.equal(found.count, value === -1e17 ? 9 : 8, String(value));
    assertAtMost(largestDifference(worldOf(found).slice(-24), world.slice(3)), 1e-6, String(value));
  }
  const near = { ...smallCloud(1, 0) };
  const both = await readAt([near, local], [{ mesh: 0 }, { mesh: 1, translation }]);
  assertAtMost(largestDifference(worldOf(both).slice(3), world), 1e-6, 'with one that is near');
});
