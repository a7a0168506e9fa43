/**
 * Runs several test files in this process, on one device: `TEST_FILES="A B" node --import tsx --test tests/support/in-one-process.ts`. Every further file reuses the compiled pipelines of the device.
 */
import { resolve } from 'node:path';
import { after, test } from 'node:test';
import { pathToFileURL } from 'node:url';
import { keepNodeDevice } from './node-device.js';

const endDevice = keepNodeDevice();
let start: () => void;
const loaded = new Promise<void>((resolveLoaded) => (start = resolveLoaded));
// The first test ends when every file is here: Node would take a moment without tests for the end of all.
test('test files load', () => loaded);
for (const file of (process.env.TEST_FILES ?? '').split(' ').filter(Boolean)) {
  try {
    await import(pathToFileURL(resolve(file)).href);
  } catch (error) {
    test(`${file} loads`, () => {
      throw error;
    });
  }
}
start!();
after(endDevice);
