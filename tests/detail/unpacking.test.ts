/** Pages for WebGL are unpacked in small tasks, however large they are, with the same result as at once. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { StreamedScene } from '@gaussian-splat/renderer';
import {
  MAX_UNPACKED,
  NodePacker,
  packNodes,
  PageUnpacker,
  treeSource,
  UNPACKED_AT_ONCE,
} from '@gaussian-splat/renderer/tools';
import { pebbles } from '../support/scenes/pebbles.js';

const SIZES = [3_000, 110_000, 20_000, 900, 64_000];

const clouds = SIZES.map((count) => pebbles(count));
const [{ shDegree, antialiased, filterVariance }] = clouds;
const scene: StreamedScene = {
  ...{
    shDegree,
    antialiased,
    filterVariance,
    shPrecision: 'float16',
    geometry: 'quantized',
    splats: 2e5,
    order: undefined,
  },
  origin: [0, 0, 0],
  bounds: { min: [-10, -10, -10], max: [10, 10, 10], center: [0, 0, 0], radius: 18 },
};

const never = (): Promise<never> => Promise.reject(new Error('no node below'));

test('no task unpacks more than sixteen slots, a page of any size is whole, and no more than needed waits', async () => {
  const packer = await NodePacker.open();
  const { signal } = new AbortController();
  const pages = await Promise.all(
    clouds.map(async (cloud, page) => {
      const content = { cloud, volumes: [], isAdded: false, error: Infinity };
      const first = packNodes([content], scene, undefined, packer);
      return {
        page,
        words: await treeSource({ scene, first, children: [], isComplete: true }, never).fetch(0, signal),
      };
    }),
  );
  const largest = Math.max(...pages.map(({ words }) => words.length));
  assert.ok(largest > MAX_UNPACKED, 'a page of more slots than may wait');
  let unpacked = 0;
  const arrived = [...pages];
  const unpacker = new PageUnpacker(
    () => arrived.shift(),
    (slot, page) => {
      unpacked++;
      return [page, slot];
    },
  );
  const steps: number[] = [];
  const step = (): void => {
    const before = unpacked;
    unpacker.step();
    steps.push(unpacked - before);
  };
  // The order of the splats is away for long.
  for (let k = 0; k < 30; k++) step();
  assert.ok(steps.at(-1) === 0 && arrived.length > 0, 'unpacked pages wait for the order');
  assert.ok(unpacked <= MAX_UNPACKED + largest, `${unpacked} slots wait`);
  const taken = [...unpacker.take()];
  while (arrived.length + unpacker.count > 0) {
    step();
    taken.push(...unpacker.take());
  }
  console.log(`${unpacked} slots in ${steps.length} tasks of at most ${Math.max(...steps)}`);
  assert.ok(steps.every((slots) => slots <= UNPACKED_AT_ONCE));
  assert.deepEqual(
    taken.map(({ page }) => page),
    pages.map(({ page }) => page),
    'the most needed first',
  );
  for (const { page, words, parts } of taken)
    assert.deepEqual(
      parts,
      words.map((slot) => [page, slot]),
      `page ${page}`,
    );
});
