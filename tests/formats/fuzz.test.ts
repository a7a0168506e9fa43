/** The fast core of `npm run lab -- fuzz-formats`. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fuzzFormat, fuzzScenes } from './support/fuzz.js';

for (const [format, scenes] of Object.entries(fuzzScenes())) {
  test(`${format}: 300 damaged scenes are read or refused by name, soon and with little memory`, async () => {
    const { files, read, refused } = await fuzzFormat(format, scenes, 300);
    assert.equal(files, 300);
    assert.ok(read > 0 && refused > 0, `${read} read, ${refused} refused`);
  });
}
