/** The shared test data beside the checkout: real captures that are not part of the project. */
import { existsSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import type { TestContext } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';

const root = fileURLToPath(new URL('../../../shared/data/', import.meta.url));

/** True if the shared data exists beside the checkout. */
export const hasSharedData = existsSync(root);

/** For `test(name, { skip: needsSharedData }, ...)`: false, or the message that says why a test is skipped. */
export const needsSharedData: false | string = hasSharedData ? false : `shared data not found at ${root}`;

/** Absolute path of a file of the shared data, for example `scenes/skull.ply`. */
export const sharedPath = (name: string): string => root + name;

/** Bytes of a file of the shared data. */
export const sharedFile = (name: string): Uint8Array => new Uint8Array(readFileSync(sharedPath(name)));

/** Skips the running test, visibly, if the shared data is absent. Returns true if it was skipped. */
export function skipWithoutSharedData(context: TestContext): boolean {
  if (!hasSharedData) context.skip(String(needsSharedData));
  return !hasSharedData;
}

/** Signs of harmonics of degrees 1 to 3 under half a turn about x. */
const HALF_TURN = [-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1];

/** Turns a cloud of an SPZ that was made in right-up-back, which today's tools do not write: half a turn about x, in place. */
export function halfTurned(cloud: GaussianCloud): GaussianCloud {
  const { count, positions, rotations, sh } = cloud;
  const stride = sh.length / count;
  for (let i = 0; i < count; i++) {
    for (const k of [1, 2]) {
      positions[3 * i + k] *= -1;
      rotations[4 * i + 1 + k] *= -1;
    }
    for (let k = 3; k < stride; k++) sh[stride * i + k] *= HALF_TURN[Math.floor(k / 3) - 1];
  }
  return cloud;
}
