/** Compressed PLYs of many splats are unpacked in WebAssembly, which the test counts. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { isLab } from '../support/extent.js';
import { seededRandom } from '../support/random.js';
import { BOUNDS, COLOR_BOUNDS, compressed } from './support/compressed-ply.js';
import { writePly } from './support/ply-writer.js';

/** The bits of the arrays of a cloud. */
const bitsOf = ({ positions, scales, rotations, opacities, sh }: GaussianCloud) =>
  [positions, scales, rotations, opacities, sh].map((array) => new Uint32Array(array.buffer, 0, array.length));

for (const restCount of isLab ? [0, 72] : [24])
  test(`WebAssembly unpacks many splats to the bits of JavaScript, ${restCount} harmonics`, async (t) => {
    const instances = t.mock.method(WebAssembly, 'Instance').mock;
    const { uniform } = seededRandom(restCount + 1);
    const integer = (end: number): number => Math.floor(uniform(0, end));
    const count = 2 ** 14 + 300;
    const word = (): number => integer(2 ** 32);
    const splats = Array.from({ length: count }, () => ({
      ...{ position: word(), rotation: word(), scale: word(), color: word() },
      rest: Array.from({ length: restCount }, () => integer(256)),
    }));
    const chunks = Math.ceil(count / 256);
    const elements = compressed(splats, { ...BOUNDS, ...COLOR_BOUNDS }, chunks);
    for (const column of elements[0].columns) {
      const of = column.values[0] as number;
      (column as { values: readonly number[] }).values = Array.from({ length: chunks }, () => of + uniform(0, 0.2));
    }
    const usual = await readScene(writePly(elements));
    assert.deepEqual([usual.count, instances.callCount()], [count, 1]);
    // Another order of the words is read in JavaScript.
    const [chunk, { name, columns }, ...rest] = elements;
    const other = await readScene(writePly([chunk, { name, columns: [...columns].reverse() }, ...rest]));
    assert.equal(instances.callCount(), 1);
    assert.deepEqual(bitsOf(usual), bitsOf(other));
  });
