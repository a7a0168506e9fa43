/** Assertions that several tests of formats share. */
import assert from 'node:assert/strict';
import { GaussianSplatError, shCoefficientCount, validateCloud, type GaussianCloud } from '@gaussian-splat/core';
import { readScene, type ReadSceneOptions } from '@gaussian-splat/formats';
import { isLab } from '../../support/extent.js';

/** Bytes from one cut of a file to the next: a prime number, so that cuts lie at all bytes of numbers and of records. */
export const CUT_STEP = isLab ? 1 : 7;

/** Asserts that a file is refused with this code, and that the error names the place of the fault and the remedy. */
export async function expectRefusal(
  bytes: Uint8Array,
  code: string,
  message: RegExp,
  options: ReadSceneOptions = { name: 'file' },
): Promise<GaussianSplatError> {
  const error = await refusalOf(bytes, options);
  assert.ok(error, 'the file was read');
  assert.equal(error.code, code, error.message);
  assert.match(error.message, message);
  assertHelpful(error, options.name ?? 'scene');
  return error;
}

/** The error that a file is refused with; undefined if it is read. Errors that are not named fail the test. */
export async function refusalOf(
  bytes: Uint8Array,
  options: ReadSceneOptions = { name: 'file' },
): Promise<GaussianSplatError | undefined> {
  try {
    validateCloud(await readScene(bytes, options));
    return undefined;
  } catch (error) {
    if (!(error instanceof GaussianSplatError)) throw error;
    return error;
  }
}

/** Every part of the message exists, and the place names the file. */
export function assertHelpful(error: GaussianSplatError, name: string): void {
  assert.ok(error.where.includes(name), `where names the file: ${error.where}`);
  for (const part of [error.expected, error.found, error.remedy]) {
    assert.ok(part.length > 0 && !/undefined|NaN|\[object/.test(part), `${error.message}: ${part}`);
  }
  assert.ok(error.message.length < 700, `short enough to read: ${error.message.length}`);
}

/** Asserts that two clouds are the same to the last bit. (A difference printed by `deepEqual` would take minutes.) */
export function assertSameCloud(a: GaussianCloud, b: GaussianCloud): void {
  for (const key of Object.keys(b) as (keyof GaussianCloud)[]) {
    const [found, expected] = [a[key], b[key]];
    if (found instanceof Float32Array && expected instanceof Float32Array) assertSameNumbers(found, expected, key);
    else assert.deepEqual(found, expected, key);
  }
}

/** Asserts that two arrays of numbers are the same, naming the first that differs. */
export function assertSameNumbers(found: ArrayLike<number>, expected: ArrayLike<number>, what = 'numbers'): void {
  assert.equal(found.length, expected.length, `number of ${what}`);
  for (let i = 0; i < found.length; i++) {
    if (!Object.is(found[i], expected[i])) assert.fail(`${what}[${i}] is ${found[i]} instead of ${expected[i]}`);
  }
}

/** Asserts that a number is not above a bound, and says both if it is. */
export function assertAtMost(value: number, bound: number, what: string): void {
  // Negated so that NaN fails.
  if (!(value <= bound)) assert.fail(`${what}: ${value} is above ${bound}`);
}

/** Largest difference between two arrays of numbers of the same length. */
export function largestDifference(a: ArrayLike<number>, b: ArrayLike<number>): number {
  assert.equal(a.length, b.length);
  let largest = 0;
  for (let i = 0; i < a.length; i++) largest = Math.max(largest, Math.abs(a[i] - b[i]));
  return largest;
}

/** Largest 1 - |dot| between the unit quaternions of two clouds: 0 for equal rotations. */
export function largestRotationError(a: GaussianCloud, b: GaussianCloud): number {
  assert.equal(a.count, b.count);
  let largest = 0;
  for (let i = 0; i < a.count; i++) {
    let dot = 0;
    for (let k = 4 * i; k < 4 * i + 4; k++) dot += a.rotations[k] * b.rotations[k];
    largest = Math.max(largest, 1 - Math.abs(dot));
  }
  return largest;
}

/** One coefficient of all splats: [N, 3]. */
export function coefficient(cloud: GaussianCloud, k: number): Float32Array {
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  return Float32Array.from(
    { length: 3 * cloud.count },
    (_, i) => cloud.sh[stride * Math.floor(i / 3) + 3 * k + (i % 3)],
  );
}
