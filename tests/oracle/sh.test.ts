import { strict as assert } from 'node:assert';
import { test } from 'node:test';
import fc from 'fast-check';
import type { Vector3 } from '@gaussian-splat/core';
import { cloudOf } from '../support/clouds.js';
import { seededRandom } from '../support/random.js';
import { shBasis, splatColor } from './sh.js';

/** Real spherical harmonics from their definition: normalized associated Legendre functions times cos(mφ) or sin(mφ). */
function fromLegendre(degree: number, [x, y, z]: Vector3): number[] {
  const phi = Math.atan2(y, x);
  const basis: number[] = [];
  for (let l = 0; l <= degree; l++) {
    for (let m = -l; m <= l; m++) {
      const k = Math.abs(m);
      const norm = Math.sqrt((((2 * l + 1) / (4 * Math.PI)) * factorial(l - k)) / factorial(l + k));
      const angular = m === 0 ? 1 : Math.SQRT2 * (m > 0 ? Math.cos(k * phi) : Math.sin(k * phi));
      basis.push(norm * angular * legendre(l, k, z));
    }
  }
  return basis;
}

/** P_l^m(t) with the Condon-Shortley sign, by the textbook recurrence in l. */
function legendre(l: number, m: number, t: number): number {
  let previous = 0;
  let current = (-1) ** m * doubleFactorial(2 * m - 1) * (1 - t * t) ** (m / 2);
  for (let n = m + 1; n <= l; n++) {
    [previous, current] = [current, ((2 * n - 1) * t * current - (n + m - 1) * previous) / (n - m)];
  }
  return current;
}

const factorial = (n: number): number => (n < 2 ? 1 : n * factorial(n - 1));
const doubleFactorial = (n: number): number => (n < 2 ? 1 : n * doubleFactorial(n - 2));

// Seeds, because fast-check's own doubles are mostly tiny or at the ends of their range.
const directions = fc.integer().map((seed) => seededRandom(seed).direction());

test('the basis equals the definition by Legendre functions, at any direction and degree', () => {
  fc.assert(
    fc.property(directions, fc.constantFrom(0, 1, 2, 3), (direction, degree) => {
      const [found, expected] = [shBasis(degree as 0 | 1 | 2 | 3, direction), fromLegendre(degree, direction)];
      assert.equal(found.length, expected.length);
      found.forEach((value, i) =>
        assert.ok(Math.abs(value - expected[i]) < 1e-12, `function ${i}: ${value}, ${expected[i]}`),
      );
    }),
  );
});

test('the 16 functions are orthonormal over the sphere', () => {
  // Four Gauss-Legendre points in z and 8 angles integrate products of degree 3 + 3 exactly.
  const [a, b] = [Math.sqrt(3 / 7 - (2 / 7) * Math.sqrt(6 / 5)), Math.sqrt(3 / 7 + (2 / 7) * Math.sqrt(6 / 5))];
  const [wa, wb] = [(18 + Math.sqrt(30)) / 36, (18 - Math.sqrt(30)) / 36];
  const gram = Array.from({ length: 16 }, () => new Float64Array(16));
  for (const [z, weight] of [
    [-a, wa],
    [a, wa],
    [-b, wb],
    [b, wb],
  ]) {
    for (let k = 0; k < 8; k++) {
      const [phi, r] = [(k * Math.PI) / 4, Math.sqrt(1 - z * z)];
      const basis = shBasis(3, [r * Math.cos(phi), r * Math.sin(phi), z]);
      for (let i = 0; i < 16; i++)
        for (let j = 0; j < 16; j++) gram[i][j] += (weight * Math.PI * basis[i] * basis[j]) / 4;
    }
  }
  for (let i = 0; i < 16; i++) {
    for (let j = 0; j < 16; j++)
      assert.ok(Math.abs(gram[i][j] - (i === j ? 1 : 0)) < 1e-12, `<${i}, ${j}> = ${gram[i][j]}`);
  }
});

test('the three functions of degree 1 are -y, z, -x', () => {
  const c = Math.sqrt(3 / (4 * Math.PI));
  const close = (a: number, b: number): void => assert.ok(Math.abs(a - b) < 1e-15, `${a}, expected ${b}`);
  close(shBasis(1, [1, 0, 0])[3], -c);
  close(shBasis(1, [0, 1, 0])[1], -c);
  close(shBasis(1, [0, 0, 1])[2], c);
});

test('a color is 0.5 + the sum over coefficients of its own channel, cut at 0 and not at 1', () => {
  const blueRow = Array.from({ length: 45 }, (_, i) => (i % 3 === 2 ? (i + 1) / 16 : 0));
  const cloud = cloudOf([{ position: [0, 0, 1], scale: 1, opacity: 1, color: [3.75, -2, 0.5], sh: blueRow }], 3);
  const direction: Vector3 = [-0.36, -0.48, 0.8];
  const [red, green, blue] = splatColor(cloud, 0, direction);
  const basis = fromLegendre(3, direction);
  const expected = basis.slice(1).reduce((sum, y, k) => sum + y * (3 * k + 3) * (1 / 16), 0.5);
  assert.ok(Math.abs(red - 3.75) < 1e-6);
  assert.equal(green, 0);
  assert.ok(Math.abs(blue - Math.max(0, expected)) < 1e-6, `${blue}, expected ${expected}`);
  assert.ok(expected > 0.01, 'the direction is chosen so that the sum is not cut');
});
