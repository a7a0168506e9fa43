/** Who comes and who goes in a pool of pages, without a GPU: against plain sorting, at full size, and until nothing changes any more. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { NONE, Residency, type PageList } from '@gaussian-splat/renderer/stages';
import { randomSource } from '../support/gpu.js';
import { pageTree, requestsOf } from '../support/page-tree.js';

const opened = (list: PageList, slots: number): Residency => {
  const residency = new Residency(list, slots);
  residency.begin(0);
  residency.settle(0);
  return residency;
};

/** Places everything that a look asks for, one page at a time. @returns pages placed */
function placeAll(residency: Residency): number {
  let placed = 0;
  for (let page = residency.nextMissing(); page !== NONE; page = residency.nextMissing()) {
    if (residency.begin(page) && residency.settle(page)) placed++;
  }
  return placed;
}

/** Looks and places until a look asks for nothing more. @returns looks */
function settle(list: PageList, residency: Residency, share: (page: number) => number): number {
  for (let looks = 1; looks <= 200; looks++) {
    residency.note(requestsOf(list, (page) => residency.isResident(page), share));
    if (placeAll(residency) === 0) return looks;
  }
  throw new Error('200 looks at one view, and pages are still exchanged');
}

test('missing pages are named in the order of what doing without them costs', () => {
  const random = randomSource(3);
  const list = pageTree(600);
  const residency = opened(list, 600);
  for (let sample = 0; sample < 20; sample++) {
    const requests = Float32Array.from({ length: list.count }, () => (random() < 0.3 ? 0 : 10 * random()));
    residency.note(requests);
    const isMissing = (page: number): boolean =>
      requests[page] > 0 && !residency.isResident(page) && residency.isResident(list.parent[page]);
    const expected = [...requests.keys()].filter((page) => page > 0 && isMissing(page)).map((page) => requests[page]);
    const found: number[] = [];
    const requested: number[] = [];
    for (let page = residency.nextMissing(); page !== NONE; page = residency.nextMissing()) {
      found.push(requests[page]);
      requested.push(page);
    }
    assert.deepEqual(
      found,
      expected.sort((a, b) => b - a),
    );
    for (const page of requested.slice(0, 20)) assert.ok(residency.begin(page) && residency.settle(page));
  }
  assert.ok(residency.slots.count > 200);
});

test('a cached page comes before those that are needed up to four times as much, and without a free slot evicts none of them', () => {
  const list = pageTree(17);
  const isCached = (page: number): boolean => page === 16;
  const residency = new Residency(list, 2, isCached);
  residency.begin(0);
  residency.settle(0);
  const sample = (...needs: [page: number, need: number][]): void => {
    const requests = new Float32Array(17);
    for (const [page, need] of needs) requests[page] = need;
    residency.note(requests);
  };
  sample([1, 5], [16, 1]);
  assert.equal(residency.nextMissing(), 1, 'five times as much');
  assert.ok(residency.begin(1) && residency.settle(1));
  sample([1, 5], [2, 9], [16, 3]);
  assert.equal(residency.nextMissing(), 16);
  assert.equal(residency.begin(16), false, 'what is there is needed more');
  assert.equal(residency.nextMissing(), 2);
  assert.ok(residency.begin(2) && residency.settle(2));
});

test('with slots for all, every page that a view requests is resident in the end', () => {
  const list = pageTree(3000);
  const residency = opened(list, 3000);
  const looks = settle(list, residency, (page) => (page % 7 === 0 ? 0 : 0.3));
  const requested = requestsOf(
    list,
    () => true,
    (page) => (page % 7 === 0 ? 0 : 0.3),
  );
  requested.forEach((request, page) => assert.equal(residency.isResident(page), request > 0, `page ${page}`));
  assert.ok(looks <= 6, `${looks} looks for a tree of four levels`);
});

test('a pool that is too small comes to rest, and nothing that is worth much more than what is there is missing', () => {
  const random = randomSource(8);
  const list = pageTree(3000);
  const residency = opened(list, 400);
  for (let view = 0; view < 10; view++) {
    const shares = Float32Array.from({ length: list.count }, () => (random() < 0.2 ? 0 : random()));
    settle(list, residency, (page) => shares[page]);
    const requests = requestsOf(
      list,
      (page) => residency.isResident(page),
      (page) => shares[page],
    );
    const isLeaf = (page: number): boolean =>
      !Array.from(residency.slots.pageIn).some((resident) => list.parent[resident] === page);
    const extra = Math.min(
      ...[...residency.slots.pageIn].filter((page) => page !== 0 && isLeaf(page)).map((page) => requests[page]),
    );
    const lacking = Math.max(...requests.filter((_, page) => !residency.isResident(page)));
    assert.ok(lacking <= 1.5 * extra, `view ${view}: ${lacking} is missing, ${extra} is there`);
  }
});

test('pages on their way are never promised the same slot', () => {
  const list = pageTree(200);
  const residency = opened(list, 17);
  settle(list, residency, (page) => (page <= 16 ? 0.1 : 0));
  assert.equal(residency.slots.count, 17);
  // All sixteen leaves may leave for others below one of them, which must stay: fifteen can come.
  const requests = new Float32Array(200);
  [0, 1].forEach((page) => (requests[page] = 1000));
  for (let page = 17; page < 33; page++) requests[page] = 500 - page;
  residency.note(requests);
  const coming: number[] = [];
  for (let page = residency.nextMissing(); page !== NONE; page = residency.nextMissing()) {
    if (residency.begin(page)) coming.push(page);
  }
  assert.deepEqual(
    coming,
    Array.from({ length: 15 }, (_, k) => 17 + k),
  );
  const left = coming.reverse().map((page) => residency.settle(page)?.left.map((evictee) => evictee.page)[0]);
  assert.equal(new Set(left).size, 15);
  assert.ok(left.every((page) => page !== undefined && page >= 2 && page <= 16));
});

/** CPU milliseconds that work takes. */
function cpuOf(work: () => void): number {
  const before = process.cpuUsage();
  work();
  const { user, system } = process.cpuUsage(before);
  return (user + system) / 1000;
}

/** CPU milliseconds of a feedback pass, the quickest of many, and of a page that replaces another, on average, in a full pool whose view changes with every pass. */
function costs(pages: number, slots: number): { sample: number; page: number } {
  const list = pageTree(pages);
  const residency = opened(list, slots);
  const view = (k: number): Float32Array =>
    requestsOf(
      list,
      (page) => residency.isResident(page),
      (page) => ((page + 31 * k) % 3 === 0 ? 0.02 : 0.5),
    );
  for (let k = 0; k < 12; k++) {
    residency.note(view(k));
    placeAll(residency);
  }
  assert.equal(residency.slots.count, slots);
  let [sample, placing, placed] = [Infinity, 0, 0];
  for (let k = 12; k < 42; k++) {
    const requests = view(k);
    sample = Math.min(
      sample,
      cpuOf(() => residency.note(requests)),
    );
    placing += cpuOf(() => {
      placed += placeAll(residency);
    });
  }
  assert.ok(placed > slots, `only ${placed} pages were exchanged`);
  return { sample, page: placing / placed };
}

test('a look and a page cost what their numbers make of it, not their product', () => {
  const [small, large] = [costs(16_750, 4375), costs(67_010, 17_500)];
  const text = ({ sample, page }: typeof small): string =>
    `${sample.toFixed(3)} ms a look, ${(1000 * page).toFixed(1)} µs a page`;
  console.log(`16,750 pages and 4,375 slots: ${text(small)}; 67,010 and 17,500: ${text(large)}`);
  assert.ok(large.sample < 8 * small.sample + 0.5, 'four times the pages, more than eight times the look');
  assert.ok(large.page < 3 * small.page + 0.02, 'four times the slots, and no longer a matter of microseconds');
});

test('of pages that find no room one is tried, and a page that is needed more and must be fetched comes nonetheless', () => {
  const list = pageTree(401, 400);
  const residency = new Residency(list, 11, (page) => page !== 400);
  const sample = (need: (page: number) => number): number[] => {
    residency.note(Float32Array.from({ length: list.count }, (_, page) => need(page)));
    const tried: number[] = [];
    for (let page = residency.nextMissing(); page !== NONE; page = residency.nextMissing()) {
      tried.push(page);
      if (residency.begin(page)) residency.settle(page);
    }
    return tried;
  };
  sample((page) => (page === 0 ? 100 : 0));
  assert.equal(sample((page) => (page <= 10 ? 100 : 0)).length, 10);
  assert.equal(residency.slots.count, 11);
  const tried = sample((page) => (page <= 10 ? 100 : page === 400 ? 200 : 101 + page / 1000));
  assert.deepEqual(tried, [399, 400]);
  assert.ok(residency.isResident(400));
});
