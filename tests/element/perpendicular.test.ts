/** The distance of parallel surfaces at right angles to them, which the ruler shows. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { perpendicularOf } from '../support/element/parts.js';

const end = (x: number, y: number, z: number, normal: readonly [number, number, number]) => {
  const [nx, ny, nz] = normal.map((value) => value / Math.hypot(...normal));
  return { x, y, z, normal: { x: nx, y: ny, z: nz } };
};

test('walls that face each other, and steps, have a distance; slanting surfaces have none', () => {
  const left = end(0, 0, 0, [1, 0, 0]);
  // However oblique the line is.
  for (const z of [0, 4, 20])
    assert.ok(Math.abs(perpendicularOf(left, end(1, 0, z, [-1, 0, 0]))! - 1) < 1e-12, `${z} m along the corridor`);
  assert.ok(Math.abs(perpendicularOf(end(0, 0, 0, [0, 1, 0]), end(0.3, 0.18, 0, [0, 1, 0]))! - 0.18) < 1e-12);
  assert.equal(perpendicularOf(left, end(1, 0, 0, [1, 0.3, 0])), null);
});

test('two points of one surface have none, although their normals are off by some degrees', () => {
  // Both sides of a door frame: 0.24 m would be a distance of nothing.
  assert.equal(perpendicularOf(end(0, 0, 0, [0.25, 0, 1]), end(0.9, 0, 0.01, [0.28, 0.1, 1])), null);
});
