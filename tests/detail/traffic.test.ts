/** Pages in flight: how many, their order, and the end of those that are no longer requested. No GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setImmediate as turn, setTimeout as pause } from 'node:timers/promises';
import {
  BRIDGED,
  DETAIL_NUMBERS,
  DetailTable,
  MAX_FETCHES,
  MAX_TRANSIT_BYTES,
  NONE,
  SLOT_CHUNKS,
  PageStreamer,
  Residency,
  type PageList,
} from '@gaussian-splat/renderer/stages';
import { randomSource } from '../support/gpu.js';
import { pageTree, requestsOf } from '../support/page-tree.js';

/** Bytes of a page of one slot, the largest that there are. */
const SLOT_BYTES = 131_072;

interface Fetch {
  readonly page: number;
  readonly signal: AbortSignal;
  readonly arrive: () => void;
  readonly fail: () => void;
}

/** A server that answers on command. */
class Server {
  readonly open: Fetch[] = [];
  /** Pages in the order of their requests. */
  readonly log: number[] = [];
  max = 0;

  readonly fetch = (page: number, signal: AbortSignal): Promise<Uint32Array<ArrayBuffer>> => {
    this.log.push(page);
    return new Promise((resolve, reject) => {
      const arrive = (): void => resolve(Uint32Array.of(page));
      this.open.push({ page, signal, arrive, fail: () => reject(new Error(`page ${page}: 404`)) });
      this.max = Math.max(this.max, this.open.filter((fetch) => !fetch.signal.aborted).length);
    });
  };

  /** Everything that is open arrives, the last first. */
  async answer(): Promise<void> {
    for (const { arrive } of this.open.splice(0).reverse()) arrive();
    await turn();
  }
}

interface Pool {
  readonly list: PageList;
  readonly residency: Residency;
  readonly traffic: PageStreamer<Uint32Array>;
  readonly server: Server;
  readonly errors: unknown[];
  /** Pages that were said to wait for their upload. */
  readonly arrivals: () => number;
  /** Feedback with the given fractions of the parents' needs; returns the page requests. */
  readonly look: (share: (page: number) => number) => Float32Array;
}

function pool(pages: number, slots: number, below = 16, now?: () => number): Pool {
  const list = pageTree(pages, below);
  const residency = new Residency(list, slots);
  residency.begin(0);
  residency.settle(0);
  const [server, errors] = [new Server(), [] as unknown[]];
  let arrivals = 0;
  const traffic = new PageStreamer(residency, {
    slotBytes: SLOT_BYTES,
    fetch: server.fetch,
    onArrival: () => {
      arrivals++;
    },
    onError: (error) => errors.push(error),
    now,
  });
  const look: Pool['look'] = (share) => {
    const requests = requestsOf(list, (page) => residency.isResident(page), share);
    residency.note(requests);
    traffic.follow();
    return requests;
  };
  return { list, residency, traffic, server, errors, arrivals: () => arrivals, look };
}

/** Places up to a number of the waiting pages. @returns them, in order */
function place({ residency, traffic }: Pool, max: number): number[] {
  const placed: number[] = [];
  for (let next = traffic.next(); next !== undefined; next = placed.length < max ? traffic.next() : undefined) {
    assert.equal(next.words[0], next.page);
    if (residency.settle(next.page)) placed.push(next.page);
    else traffic.refused();
  }
  return placed;
}

test('a thousand pages that arrive as fast as they are sent for: few are under way, the most needed come first, all are there in the end', async () => {
  const all = pool(1200, 1200);
  const random = randomSource(2);
  const shares = Float32Array.from({ length: 1200 }, () => 0.1 + 0.9 * random());
  for (let frame = 0; all.residency.slots.count < 1200; frame++) {
    assert.ok(frame < 1000, `${all.residency.slots.count} of 1200 pages after 1000 frames`);
    if (frame % 6 === 0) all.look((page) => shares[page]);
    for (let answers = 0; answers < 3; answers++) await all.server.answer();
    assert.ok(all.traffic.bytes < MAX_TRANSIT_BYTES + 2 * SLOT_BYTES && all.server.max <= MAX_FETCHES);
    const needs = place(all, 5).map((page) => all.residency.need(page));
    assert.deepEqual(
      needs,
      [...needs].sort((a, b) => b - a),
    );
    all.traffic.sendForMore();
  }
  assert.equal(all.server.log.length, 1200 - 1, 'each page is sent for once');
  assert.equal(all.traffic.abandoned, 0);
  assert.equal(all.traffic.underWay, 0);
});

test('what is sent for is what is needed most of all that can come', () => {
  const all = pool(300, 300);
  const random = randomSource(4);
  const requests = all.look(() => random());
  const expected = [...Array(17).keys()].slice(1).sort((a, b) => requests[b] - requests[a]);
  assert.deepEqual(all.server.log, expected.slice(0, MAX_FETCHES));
});

test('pages that two feedback passes do not request are canceled, and may be requested again', async () => {
  const all = pool(300, 300, 200);
  all.look(() => 0.5);
  await all.server.answer();
  const [waiting, fetching] = [all.traffic.waiting, all.server.open.length];
  assert.equal(waiting, MAX_FETCHES);
  assert.equal(fetching, MAX_FETCHES);
  const stale = all.server.open.splice(0);
  all.look(() => 0);
  assert.equal(all.traffic.next(), undefined, 'no page is placed that the last feedback pass does not request');
  assert.equal(
    all.traffic.underWay,
    2 * MAX_FETCHES,
    'one feedback pass alone cancels nothing, because another view may follow',
  );
  all.look(() => 0);
  assert.equal(all.traffic.underWay, 0);
  assert.equal(all.traffic.abandoned, 2 * MAX_FETCHES);
  assert.ok(stale.every(({ signal }) => signal.aborted));
  all.look(() => 0.5);
  assert.equal(all.server.open.length, MAX_FETCHES);
  // Cancelled pages arrive late, or fail as aborted fetches do: neither counts.
  stale.forEach(({ arrive, fail }, k) => (k % 2 ? arrive() : fail()));
  await turn();
  assert.equal(all.traffic.waiting, 0);
  assert.deepEqual(all.errors, []);
  for (let round = 0; round < 20; round++) {
    await all.server.answer();
    place(all, 16);
    all.traffic.sendForMore();
  }
  assert.equal(all.residency.slots.count, 201, 'the root and what is below it');
});

test('failing pages are reported once and free their slots, and a closed scene reports nothing', async () => {
  const all = pool(300, 300, 200);
  all.look(() => 0.5);
  const failed = all.server.open.splice(0);
  for (const { fail } of failed) fail();
  await turn();
  assert.equal(all.errors.length, MAX_FETCHES);
  assert.equal(all.server.open.length, MAX_FETCHES, 'the next ones are sent for');
  assert.equal(all.arrivals(), 0, 'there is nothing to draw');
  all.look(() => 0.5);
  const again = all.server.log.slice(MAX_FETCHES).filter((page) => failed.some((fetch) => fetch.page === page));
  assert.deepEqual(again, [], 'not for four seconds');
  all.traffic.close();
  const open = all.server.open.splice(0);
  assert.ok(open.every(({ signal }) => signal.aborted));
  open.forEach(({ fail }) => fail());
  await turn();
  assert.equal(all.errors.length, MAX_FETCHES);
  assert.equal(all.server.open.length, 0);
});

test('what had no room beside a page that does not come is sent for without another look', async () => {
  const all = pool(3, 2);
  all.look((page) => (page === 1 ? 0.9 : 0.5));
  assert.deepEqual(all.server.log, [1]);
  all.server.open.splice(0).forEach(({ fail }) => fail());
  await pause(500);
  assert.deepEqual(all.server.log, [1, 2]);
  await all.server.answer();
  assert.deepEqual(place(all, 1), [2]);
  all.traffic.close();
});

test('a page that fails again and again is asked for after 4 s, then 8 s, and so on', async () => {
  let now = 0;
  const all = pool(2, 2, 16, () => now);
  const isAskedAt = (seconds: number): boolean => {
    now = 1000 * seconds;
    all.look(() => 0.5);
    return all.server.open.length > 0;
  };
  const fail = async (): Promise<void> => {
    all.server.open.splice(0).forEach((fetch) => fetch.fail());
    await turn();
  };
  assert.ok(isAskedAt(0));
  for (const [from, to] of [
    [0, 4],
    [4, 12],
    [12, 28],
  ]) {
    await fail();
    assert.ok(!isAskedAt(to - 0.1), `${to - from} s have not passed`);
    assert.ok(isAskedAt(to));
  }
  await all.server.answer();
  assert.equal(all.arrivals(), 1);
  assert.deepEqual(place(all, 1), [1]);
  all.traffic.close();
});

test('a page that never arrives is reported once, and abandoned after eight attempts', async () => {
  let now = 0;
  const all = pool(2, 2, 16, () => now);
  for (let minute = 0; minute < 120; minute++) {
    now = 60_000 * minute;
    all.look(() => 0.5);
    all.server.open.splice(0).forEach((fetch) => fetch.fail());
    await turn();
  }
  assert.equal(all.server.log.length, 8);
  assert.equal(all.errors.length, 1);
  all.traffic.close();
});

test('in a small pool, with any order of arrivals, the ancestors of a page are resident, and views at rest settle', async () => {
  const all = pool(2000, 120);
  const random = randomSource(6);
  for (let view = 0; view < 12; view++) {
    const shares = Float32Array.from({ length: 2000 }, () => (random() < 0.3 ? 0 : random()));
    let last = -1;
    for (let frame = 0; frame < 600 && last !== all.server.log.length; frame++) {
      // One view in three ends before its requested pages are resident.
      if (view % 3 === 0 && frame > 20) break;
      if (frame % 30 === 29) last = all.server.log.length;
      if (frame % 3 === 0) all.look((page) => shares[page]);
      const some = all.server.open.splice(0).filter((fetch) => (random() < 0.5 ? (fetch.arrive(), false) : true));
      all.server.open.push(...some);
      await turn();
      place(all, Math.floor(3 * random()));
      all.traffic.sendForMore();
      const residents = [...all.residency.slots.pageIn].filter((page) => page !== NONE);
      assert.equal(new Set(residents).size, residents.length);
      for (const page of residents.filter((page) => page !== 0)) {
        assert.ok(all.residency.isResident(all.list.parent[page]), `page ${page} hangs in the air`);
      }
      assert.ok(all.traffic.bytes < MAX_TRANSIT_BYTES + 2 * SLOT_BYTES);
      assert.ok(frame < 599, `view ${view} never comes to rest`);
    }
  }
  assert.ok(all.traffic.abandoned > 0 && all.residency.slots.count === 120);
});

test('rows that changed are written once, in pieces that never reach over a buffer', () => {
  const [slots, perBuffer] = [500, 64];
  const random = randomSource(9);
  const table = new DetailTable(slots);
  const written = new Float32Array(DETAIL_NUMBERS * SLOT_CHUNKS * slots);
  const stride = DETAIL_NUMBERS * SLOT_CHUNKS;
  for (let frame = 0; frame < 50; frame++) {
    const changed = Array.from({ length: Math.floor(40 * random()) }, () => Math.floor(slots * random() ** 2));
    for (const slot of changed) {
      table.rowsOf(slot).fill(random());
      table.touch(slot);
    }
    let [pieces, rows] = [0, 0];
    table.flush(perBuffer, (first, numbers) => {
      const count = numbers.length / stride;
      assert.equal(Math.floor(first / perBuffer), Math.floor((first + count - 1) / perBuffer));
      written.set(numbers, stride * first);
      pieces++;
      rows += count;
    });
    const different = new Set(changed).size;
    assert.ok(
      pieces <= different && rows <= (1 + BRIDGED) * different,
      `${pieces} pieces of ${rows} slots for ${different}`,
    );
    for (let slot = 0; slot < slots; slot++) {
      assert.deepEqual(written.subarray(stride * slot, stride * (slot + 1)), table.rowsOf(slot), `slot ${slot}`);
    }
  }
  table.flush(perBuffer, () => assert.fail('nothing has changed since'));
});
