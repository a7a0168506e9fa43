/**
 * The fast core of `npm run lab -- fuzz-formats`: hostile files of every reader are read or refused by name, at a cost that
 * their size bounds.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { detectFormat, sceneFormats } from '@gaussian-splat/formats';
import { allReaders, fuzzReader, type Reader } from './support/fuzz.js';
import { fuzzScenes } from './support/fuzz-scenes.js';
import { BOUNDS, excesses, measuredReading } from './support/reading.js';

const COUNT = 80;
const readers = await allReaders();

test('each format of the registry has files to make hostile ones of, which are read', async () => {
  const formats = sceneFormats.map(({ name }) => name);
  assert.deepEqual(
    formats.filter((name) => !(name in readers)),
    [],
  );
  for (const [format, scenes] of Object.entries(fuzzScenes()))
    for (const { name, files } of scenes)
      if (format !== 'tiles' && format !== 'splat') assert.equal(detectFormat(files[name], name), format, name);
  for (const [reader, { kind, scenes }] of Object.entries(readers)) {
    assert.ok(scenes.length > 0, reader);
    const { outcome } = await measuredReading(kind, scenes[0]);
    assert.equal(outcome, 'read', `${reader}: ${scenes[0].name}`);
  }
});

test('the harness sees each cost', () => {
  const none = { heldBytes: 0, sentBytes: 0, requests: 0, gpuBytes: 0, cpuMs: 0 };
  assert.deepEqual(excesses({ outcome: 'read', bytes: 100, costs: none }), []);
  for (const cost of Object.keys(BOUNDS) as (keyof typeof BOUNDS)[]) {
    const costs = { ...none, [cost]: BOUNDS[cost](100) + 1 };
    assert.match(excesses({ outcome: 'read', bytes: 100, costs })[0], new RegExp(`^${cost} `));
  }
});

for (const [reader, own] of Object.entries(readers))
  test(`${reader}: ${COUNT} hostile files cost what they weigh`, async () => {
    const { files, read, refused } = await fuzzReader(reader as Reader, own, { count: COUNT });
    assert.equal(files, COUNT);
    assert.ok(read > 0 && refused > 0, `${read} read, ${refused} refused`);
  });
