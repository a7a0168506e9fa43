/** Any JSON in place of a `detail.json`: it is refused with a name, or every page of it can come. No GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { checkManifest, type DetailManifest } from '@gaussian-splat/renderer';
import { listPages, NONE, SLOT_CHUNKS } from '@gaussian-splat/renderer/stages';
import { detailFolder } from '../support/detail-folder.js';
import { randomSource } from '../support/gpu.js';
import { pebbles } from '../support/scenes/pebbles.js';

const PLACES = [
  [0, 0, 0],
  [1, 2, 3],
  [4, 5, 6],
] as const;
/** One of each version. */
const manifests = [undefined, 'quantized' as const].map(
  (geometry) => detailFolder(pebbles(6_000), PLACES, { geometry }).manifest,
);
const ODD = ['null', '-1', '0', '1', '4', '5', '20', '21', '1e9', '1e300', '0.5', '""', '[]', '{}', '[0,0]', '[1e9,0]'];

/** Puts something else in one place of a JSON value, or takes it away, or doubles it. */
function change(root: object, random: () => number): void {
  const pick = <T>(values: readonly T[]): T => values[Math.floor(random() * values.length)];
  let node = root as Record<string, unknown>;
  for (;;) {
    const keys = Object.keys(node);
    if (keys.length === 0) return;
    const key = pick(keys);
    const value = node[key];
    if (typeof value === 'object' && value !== null && random() < 0.8) {
      node = value as Record<string, unknown>;
      continue;
    }
    const what = random();
    if (what < 0.6) node[key] = JSON.parse(pick(ODD));
    else if (what < 0.8) delete node[key];
    else if (Array.isArray(node)) node.push(structuredClone(value));
    else if (typeof value === 'number') node[key] = value + pick([-1, 1, 4]);
    return;
  }
}

/** Each page but the first is below a chunk of an earlier one, and each chunk has one page below it at most. */
function checkPages(found: DetailManifest): void {
  const list = listPages(found);
  const above = new Uint32Array(list.count);
  for (let page = 0; page < list.count; page++) {
    const { file, first, chunks } = list.place(page);
    assert.ok(chunks >= 1 && chunks <= SLOT_CHUNKS && first + chunks <= file.chunks);
    for (let chunk = 0; chunk < chunks; chunk++) {
      const below = list.children[SLOT_CHUNKS * page + chunk];
      if (below === NONE) continue;
      assert.ok(below > page && list.parent[below] === page);
      above[below]++;
    }
  }
  assert.ok(above.every((times, page) => times === (page === 0 ? 0 : 1)));
}

test('after any change a manifest is refused with a name, or each of its pages is below one chunk', () => {
  const random = randomSource(11);
  const texts = manifests.map((manifest) => JSON.stringify(manifest));
  for (const text of texts) checkPages(checkManifest(JSON.parse(text), 'detail.json'));
  let [taken, refused] = [0, 0];
  for (let trial = 0; trial < 6000; trial++) {
    const changed = JSON.parse(texts[trial % 2]) as object;
    for (let changes = Math.ceil(3 * random()); changes > 0; changes--) change(changed, random);
    let found: DetailManifest;
    try {
      found = checkManifest(JSON.parse(JSON.stringify(changed)), 'detail.json');
    } catch (error) {
      assert.ok(error instanceof GaussianSplatError, `${(error as Error).stack}: ${JSON.stringify(changed)}`);
      refused++;
      continue;
    }
    checkPages(found);
    taken++;
  }
  console.log(`${taken} taken, ${refused} refused`);
  assert.ok(taken > 100 && refused > 1000);
});

test('the version of a manifest determines how geometry is stored, and readers of either reject the other', () => {
  const [exact, quantized] = manifests;
  assert.deepEqual(
    [exact.version, exact.geometry, quantized.version, quantized.geometry],
    [1, undefined, 2, 'quantized'],
  );
  const refused = [
    { ...quantized, version: 1 },
    { ...quantized, geometry: undefined },
    { ...quantized, geometry: 'halved' },
    { ...exact, version: 2 },
    { ...exact, version: 3 },
  ];
  for (const manifest of refused) assert.throws(() => checkManifest(manifest, 'detail.json'), /decode\/unsupported/);
});

test('lists within lists, where a manifest has something else, are refused with a name', () => {
  const deep: unknown = JSON.parse('['.repeat(100_000) + ']'.repeat(100_000));
  assert.throws(() => checkManifest({ ...manifests[0], bounds: deep }, 'detail.json'), { code: 'decode/header' });
  assert.throws(() => checkManifest({ format: deep }, 'detail.json'), { code: 'decode/unsupported' });
  const inside = { center: [0, 1, 2], radius: 1, toward: [0, 1, 3] };
  for (const [view, isRefused] of [
    [inside, false],
    [{ ...inside, toward: deep }, true],
    [{ ...inside, radius: '1' }, true],
  ]) {
    const check = (): unknown =>
      checkManifest({ ...manifests[0], bounds: { ...manifests[0].bounds, inside: view } }, 'detail.json');
    if (isRefused) assert.throws(check, /bounds\.inside/);
    else check();
  }
});

test('an address that no server accepts is refused, because each request of a page parses it', () => {
  const [first] = manifests[1].trees[0].pages;
  const named = (length: number): unknown => ({
    ...manifests[1],
    trees: [{ pages: [{ ...first, file: 'a'.repeat(length) }] }],
  });
  assert.throws(() => checkManifest(named(2049), 'detail.json'), { code: 'decode/header' });
});

test('a manifest is checked in a time that grows as its files do', () => {
  const [first] = manifests[1].trees[0].pages;
  // Each file below the last chunk of the one before.
  const pages = Array.from({ length: 60_000 }, (_, p) => ({
    ...{ file: first.file, chunks: 5, upper: 1 },
    ...(p > 0 && { parent: [p - 1, 4] as const }),
  }));
  const long = { ...manifests[1], trees: [{ pages }], instances: [{ tree: 0, translate: [0, 0, 0] }] };
  const start = process.cpuUsage();
  checkManifest(long, 'detail.json');
  const seconds = process.cpuUsage(start).user / 1e6;
  console.log(`60,000 files: ${seconds.toFixed(2)} s`);
  assert.ok(seconds < 1.5, `${seconds} s`);
});
