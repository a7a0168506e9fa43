/** Objects of a scene: their numbers in PLY files, and hiding, tinting and measuring them. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { boundsOf, GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { readGroups, SplatGroups } from '@gaussian-splat/formats/groups';

const BASE = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2'];
const NAMES = [...BASE, 'rot_0', 'rot_1', 'rot_2', 'rot_3'];

/** A PLY of text whose splats have the given numbers in a further property. Splat i is at x = i. */
function plyOf(
  property: string,
  type: string,
  ids: readonly (number | string)[],
  bad: readonly number[] = [],
): Uint8Array {
  const rows = ids.map((id, i) => {
    const rotation = bad.includes(i) ? '0 0 0 0' : '1 0 0 0';
    return `${i} 0 ${0.1 * i} 0.5 -0.2 ${0.1 * i} ${i - 2} -3 -3 -3 ${rotation} ${id}`;
  });
  const head = ['ply', 'format ascii 1.0', `element vertex ${ids.length}`];
  const properties = [...NAMES.map((name) => `property float ${name}`), `property ${type} ${property}`];
  return new TextEncoder().encode([...head, ...properties, 'end_header', ...rows, ''].join('\n'));
}

const color = ({ sh }: Pick<GaussianCloud, 'sh'>, i: number): number[] =>
  [0, 1, 2].map((channel) => 0.5 + 0.28209479177387814 * sh[3 * i + channel]);

test('numbers of objects are read from the properties that tools write, for the splats that are kept', async () => {
  const cases: [string, string, (number | string)[]][] = [
    ['object_id', 'int', [7, -1, 7, 3, 3]],
    ['label', 'uchar', [0, 1, 2, 1, 0]],
    ['instance_id', 'float', ['2.0', '4.0', '2.0', '4.0', '2.0']],
    ['scalar_label', 'short', [5, 5, 6, 6, 6]],
  ];
  for (const [property, type, ids] of cases) {
    const bytes = plyOf(property, type, ids, [1]);
    const { cloud, ids: read, property: found } = await readGroups(bytes);
    assert.equal(found, property.replace('scalar_', ''));
    assert.deepEqual([...read], ids.filter((_, i) => i !== 1).map(Number));
    const plain = await readScene(bytes);
    assert.deepEqual(cloud.positions, plain.positions);
    assert.equal(cloud.droppedCount, 1);
  }
  const named = await readGroups(plyOf('floor_of_building', 'int', [1, 2]), { property: 'floor_of_building' });
  assert.deepEqual([...named.ids], [1, 2]);
});

test('a file without the property is an error that names those that it has', async () => {
  const bytes = plyOf('obj_dc_0', 'float', [1, 2]);
  const isMissing = (error: unknown): boolean =>
    error instanceof GaussianSplatError && error.code === 'argument/value' && /obj_dc_0/.test(error.found);
  await assert.rejects(readGroups(bytes), isMissing);
  await assert.rejects(readGroups(bytes, { property: 'label' }), isMissing);
  await assert.rejects(readGroups(new TextEncoder().encode('no PLY')), GaussianSplatError);
});

test('a splat has a group, and groups are hidden, tinted and measured by name', async () => {
  const { cloud, ids } = await readGroups(plyOf('object_id', 'int', [7, 7, 3, 3, 3]));
  const groups = new SplatGroups(cloud, ids, { 3: 'chair' });
  assert.deepEqual(groups.groups, [
    { id: 3, name: 'chair', count: 3 },
    { id: 7, name: '7', count: 2 },
  ]);
  assert.equal(groups.of(4)?.name, 'chair');
  assert.deepEqual([groups.of(null), groups.of(5), groups.of(undefined)], [undefined, undefined, undefined]);
  const { min, max } = groups.boundsOf('chair');
  assert.deepEqual([min[0], max[0]], [2, 4]);
  assert.deepEqual(groups.boundsOf('7'), boundsOf({ ...cloud, count: 2 }));

  const before = { opacities: cloud.opacities.slice(), sh: cloud.sh.slice() };
  const hidden = groups.arraysFor({ hide: ['chair'] });
  assert.deepEqual([...hidden.opacities], [cloud.opacities[0], cloud.opacities[1], 0, 0, 0]);
  assert.equal(hidden.sh, undefined);
  assert.deepEqual([...groups.arraysFor({ only: ['chair'] }).opacities].slice(0, 2), [0, 0]);
  const { sh } = groups.arraysFor({ tint: { chair: [1, 0.5, 0] } });
  assert.deepEqual(color({ sh: sh! }, 0), color(cloud, 0));
  const [red, green, blue] = color(cloud, 3);
  const luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  color({ sh: sh! }, 3).forEach((value, channel) => assert.ok(Math.abs(value - luma * [1, 0.5, 0][channel]) < 1e-6));
  assert.deepEqual(groups.arraysFor({}), before, 'the colors of the file return once');
  assert.equal(groups.arraysFor({}).sh, undefined);
  assert.deepEqual({ opacities: cloud.opacities, sh: cloud.sh }, before, 'the cloud is unchanged');
});

test('unknown names, and numbers of another scene, are errors', async () => {
  const { cloud, ids } = await readGroups(plyOf('object_id', 'int', [7, 3]));
  const groups = new SplatGroups(cloud, ids);
  const isNamed = (error: unknown): boolean => error instanceof GaussianSplatError && /3, 7.*table/.test(error.message);
  assert.throws(() => groups.arraysFor({ hide: ['table'] }), isNamed);
  assert.throws(() => groups.boundsOf('table'), isNamed);
  assert.throws(() => new SplatGroups(cloud, ids.subarray(1)), /2 numbers, one for each splat/);
});
