/**
 * The fast core of `npm run lab -- fuzz-formats`: hostile files of every reader are read or refused by name, at a cost that
 * their size bounds.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { detectFormat, sceneFormats } from '@gaussian-splat/formats';
import { allReaders, fuzzReader, type Reader } from './support/fuzz.js';
import { isLab } from '../support/extent.js';
import { fuzzScenes, type FuzzScene, type ReaderKind } from './support/fuzz-scenes.js';
import { BOUNDS, excesses, growthDuring, measuredReading } from './support/reading.js';

/** `npm run lab -- fuzz-formats` reads hundreds. */
const COUNT = isLab ? 80 : 40;
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

test('the harness sees each cost', async () => {
  const growth = await growthDuring(() => Promise.resolve(new Uint8Array(3e8).fill(1)));
  assert.ok(growth > 2e8, `${growth} bytes`);
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

const CASES = '../shared/cases/attack-4';
const KINDS: Readonly<Record<string, ReaderKind>> = {
  'floor-cell.floor': 'floor',
  'clip-many-780k.4dgs': 'clip',
  'clip-groups-258k.4dgs': 'clip',
  'tiles-implicit': 'load',
  'tiles-nested': 'load',
};
/** A file, or a folder with a tileset. */
function caseOf(name: string): FuzzScene {
  const path = join(CASES, name);
  if (statSync(path).isFile()) return { name, files: { [name]: new Uint8Array(readFileSync(path)) } };
  const within = readdirSync(path, { recursive: true }).map(String);
  const files = within.filter((file) => statSync(join(path, file)).isFile());
  return {
    name: 'tileset.json',
    files: Object.fromEntries(files.map((file) => [file, new Uint8Array(readFileSync(join(path, file)))])),
  };
}

for (const [name, kind] of Object.entries(KINDS))
  test(
    `${name}, which cost far more than it weighs`,
    { skip: !existsSync(CASES) && 'no shared cases' },
    async (context) => {
      const reading = await measuredReading(kind, caseOf(name));
      context.diagnostic(JSON.stringify(reading));
      assert.deepEqual(excesses(reading), []);
      assert.notEqual(reading.outcome, 'read');
    },
  );
