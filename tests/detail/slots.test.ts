/** Pages of several slots, as runs of a file's own levels are: who comes and who goes, without a GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setImmediate as turn } from 'node:timers/promises';
import {
  MAX_TRANSIT_BYTES,
  NONE,
  SLOT_CHUNKS,
  PageStreamer,
  Residency,
  type PageList,
} from '@gaussian-splat/renderer/stages';
import { randomSource } from '../support/gpu.js';
import { boxList, requestsOf } from '../support/page-tree.js';

/** Boxes of one to four levels, the finest of up to 400 chunks. */
function randomBoxes(count: number, random: () => number): PageList {
  return boxList(
    Array.from({ length: count }, () => {
      const coarsest = 1 + Math.floor(4 * random());
      return Array.from({ length: 1 + Math.floor(4 * random()) }, (_, k) =>
        Math.floor(coarsest * (2 + 2.5 * random()) ** k),
      );
    }),
  );
}

function opened(list: PageList, slots: number): Residency {
  const residency = new Residency(list, slots);
  assert.ok(residency.begin(0));
  assert.equal(residency.settle(0)?.slots.length, list.slots[0]);
  return residency;
}

/** Asserts that each page is in as many slots as it needs, each slot holds one page, and a page's parents are resident. @returns slots in use */
function check(list: PageList, residency: Residency): number {
  const residents = [...new Set(residency.slots.pageIn)].filter((page) => page !== NONE);
  assert.equal(residency.slots.count, residents.length);
  for (const page of residents) {
    const slots = residency.slots.of(page);
    assert.equal(slots.length, list.slots[page], `page ${page}`);
    assert.equal(new Set(slots).size, slots.length);
    assert.ok(slots.every((slot) => residency.slots.pageIn[slot] === page));
    assert.equal(residency.slots.slotOf[page], slots[0]);
    if (page !== 0) assert.ok(residency.isResident(list.parent[page]), `page ${page} hangs in the air`);
  }
  for (let page = 0; page < list.count; page++) {
    if (!residents.includes(page)) assert.equal(residency.slots.slotOf[page], NONE);
  }
  return residents.reduce((sum, page) => sum + list.slots[page], 0);
}

test('with any requests, arrivals and failures, pages are complete or absent, and their ancestors are resident', () => {
  const random = randomSource(21);
  const list = randomBoxes(60, random);
  const slots = list.slots[0] + 30;
  const residency = opened(list, slots);
  const coming: number[] = [];
  let [placed, refused, several, max] = [0, 0, 0, 0];
  for (let step = 0; step < 4000; step++) {
    residency.note(Float32Array.from({ length: list.count }, () => (random() < 0.5 ? 0 : 10 * random())));
    for (let page = residency.nextMissing(); page !== NONE && coming.length < 5; page = residency.nextMissing()) {
      if (residency.begin(page)) coming.push(page);
    }
    const [page] = coming.splice(Math.floor(random() * coming.length), 1);
    if (page === undefined) continue;
    if (random() < 0.2) {
      residency.cancel(page);
      continue;
    }
    const before = new Set(residency.slots.pageIn);
    const settled = residency.settle(page);
    if (settled === undefined) {
      refused++;
      assert.deepEqual(new Set(residency.slots.pageIn), before, 'a page that finds no room drives nothing out');
      continue;
    }
    placed++;
    if (settled.left.length > 1) several++;
    for (const { page: evictee } of settled.left) assert.ok(before.has(evictee) && !residency.isResident(evictee));
    max = Math.max(max, check(list, residency));
  }
  console.log(`${placed} placed, ${several} of them for several others, ${refused} refused; ${max} of ${slots} slots`);
  assert.ok(placed > 500 && several > 50 && max > slots - 3);
});

test('a page that does not fit beside what is above it is never sent for, and keeps nothing else away', () => {
  // The finest run of the first box takes 10 slots; there are 12, and the runs above it take 3.
  const list = boxList([
    [4, 8, 40],
    [4, 12],
    [4, 4],
  ]);
  const residency = opened(list, 3 + 2 + 7);
  for (let look = 0; look < 4; look++) {
    residency.note(
      requestsOf(
        list,
        (page) => residency.isResident(page),
        () => 0.9,
      ),
    );
    for (let page = residency.nextMissing(); page !== NONE; page = residency.nextMissing()) {
      assert.notEqual(page, 2, 'the page of 10 slots');
      assert.ok(residency.begin(page) && residency.settle(page));
    }
  }
  assert.deepEqual(
    [0, 1, 2, 3, 4].map((page) => residency.isResident(page)),
    [true, true, false, true, true],
  );
});

test('a large page for which too little can leave keeps no small one from coming that has room', () => {
  const list = boxList([
    [4, 40],
    [4, 20],
    [4, 4],
  ]);
  const residency = opened(list, 3 + 5 + 6);
  const look = (...requests: number[]): void => residency.note(Float32Array.of(0, ...requests));
  look(0, 50, 0);
  assert.ok(residency.nextMissing() === 2 && residency.begin(2) && residency.settle(2));
  // Ten slots: six are empty, and the pages in the others are needed nearly as much.
  look(60, 50, 1);
  assert.equal(residency.nextMissing(), 1);
  assert.equal(residency.begin(1), false);
  assert.equal(residency.nextMissing(), 3);
  assert.ok(residency.begin(3) && residency.settle(3));
  // Both pages are evicted for one that is needed far more.
  look(90, 50, 1);
  assert.equal(residency.nextMissing(), 1);
  assert.ok(residency.begin(1));
  const settled = residency.settle(1);
  assert.deepEqual(settled?.left.map(({ page }) => page).sort(), [2, 3]);
  assert.equal(check(list, residency), 3 + 10);
});

test('views at rest come to rest in a pool that is too small, and nothing that has room and is needed is missing', () => {
  const random = randomSource(5);
  const list = randomBoxes(80, random);
  const residency = opened(list, list.slots[0] + 40);
  for (let view = 0; view < 30; view++) {
    const shares = Float32Array.from({ length: list.count }, () => (random() < 0.2 ? 0 : random()));
    const requests = (): Float32Array =>
      requestsOf(
        list,
        (page) => residency.isResident(page),
        (page) => shares[page],
      );
    let placed = -1;
    for (let looks = 0; placed !== 0; looks++) {
      assert.ok(looks < 100, `view ${view} never comes to rest`);
      residency.note(requests());
      placed = 0;
      for (let page = residency.nextMissing(); page !== NONE; page = residency.nextMissing()) {
        if (residency.begin(page) && residency.settle(page)) placed++;
      }
    }
    const left = residency.slots.pageIn.length - check(list, residency);
    requests().forEach((request, page) => {
      if (request > 0 && !residency.isResident(page)) assert.ok(list.slots[page] > left, `page ${page} has room`);
    });
  }
});

test('pages in transit are bounded in bytes: of their words, twice while they are fetched, and of their true size once it is known', async () => {
  const slotBytes = 500_000;
  const list = boxList(Array.from({ length: 200 }, (_, k) => [1, k % 3 === 0 ? 60 : 8]));
  // Some pages turn out to be larger than expected when they arrive.
  const sizes = list.slots.slice();
  for (let page = 3; page < list.count; page += 7) list.slots[page] = 1;
  const residency = opened(list, 2000);
  const fetching = new Map<number, () => void>();
  const waiting = new Set<number>();
  const traffic = new PageStreamer(residency, {
    slotBytes,
    fetch: (page) =>
      new Promise((resolve) =>
        fetching.set(page, () => {
          list.slots[page] = sizes[page];
          resolve(new Uint32Array(1));
        }),
      ),
    onArrival: () => undefined,
    onError: (error) => assert.fail(String(error)),
  });
  const bytesOf = (pages: Iterable<number>): number =>
    [...pages].reduce((sum, page) => sum + slotBytes * list.slots[page], 0);
  const largest = 2 * slotBytes * Math.max(...sizes.subarray(1));
  let [fullest, seen] = [0, 0];
  for (let round = 0; round < 600 && residency.slots.count < list.count; round++) {
    const before = fetching.size;
    residency.note(
      requestsOf(
        list,
        (page) => residency.isResident(page),
        () => 0.5,
      ),
    );
    traffic.follow();
    const bytes = 2 * bytesOf(fetching.keys()) + bytesOf(waiting);
    assert.equal(traffic.bytes, bytes);
    if (fetching.size > before) assert.ok(bytes < MAX_TRANSIT_BYTES + largest, `${bytes} bytes`);
    [fullest, seen] = [Math.max(fullest, bytes), Math.max(seen, fetching.size + waiting.size)];
    // Pages arrive faster than they are uploaded.
    for (const [page, arrive] of [...fetching].slice(0, 3)) {
      arrive();
      fetching.delete(page);
      waiting.add(page);
      await turn();
    }
    const next = traffic.next();
    if (next !== undefined && residency.settle(next.page)) waiting.delete(next.page);
  }
  console.log(`up to ${seen} pages and ${fullest / 1e6} MB in transit`);
  assert.ok(fullest >= MAX_TRANSIT_BYTES, 'the limit is used');
  assert.equal(residency.slots.count, list.count);
  assert.equal(traffic.underWay, 0);
  assert.equal(traffic.bytes, 0);
  assert.equal(list.chunks[1], 60);
  assert.equal(list.slots[1], 60 / SLOT_CHUNKS);
});
