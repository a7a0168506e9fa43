/** The shared test data beside the checkout: real captures that are not part of the project. */
import { existsSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import type { TestContext } from 'node:test';

const root = fileURLToPath(new URL('../../../shared/data/', import.meta.url));

/** True where the shared data lies beside the checkout. */
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
