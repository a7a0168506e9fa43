/**
 * Parts of a clip in the page's memory: bounded for any playing time, the next group before a finer image of this one.
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { ClipIndex } from '@gaussian-splat/formats';
import type { PackedAnimation } from '@gaussian-splat/renderer/tools';
import { GroupCache, partsIn } from '../../packages/element/dist/sources/clip/group-cache.js';
import { onlyInLab } from '../support/extent.js';

const FRAMES = 30;
const SPLATS = 150_000;
const PLANES = 40;
/** Groups of 20 MB that memory has room for, and one that is being fetched. */
const MAX_HELD = 9;
/** A part in memory, without the memory. */
const partOf = (splats: number): PackedAnimation =>
  ({
    rows: splats,
    bases: { byteLength: 48 * splats },
    sh: { byteLength: 8 * splats },
    codes: { byteLength: 2 * PLANES * splats },
    curves: { byteLength: 0 },
  }) as unknown as PackedAnimation;

function clip(groups: number, stillSplats: readonly number[] = []): ClipIndex {
  const part = (splats: number): object => ({ splats, planes: PLANES, sceneBytes: 1, motionBytes: 1, start: 0 });
  return {
    framesPerSecond: 30,
    still: stillSplats.map(part),
    groups: Array.from({ length: groups }, (_, k) => ({
      ...{ first: FRAMES * k, frames: FRAMES },
      parts: [part(SPLATS / 8), part((7 * SPLATS) / 8)],
    })),
  } as unknown as ClipIndex;
}

interface Bench {
  readonly cache: GroupCache;
  readonly asked: string[];
  readonly errors: unknown[];
  settle(): Promise<void>;
}

function bench(index: ClipIndex, fails: (group: number) => boolean = () => false): Bench {
  const asked: string[] = [];
  const errors: unknown[] = [];
  const cache = new GroupCache(index, {
    fetchPart: async (group, part, signal) => {
      asked.push(`${group}.${part}`);
      await Promise.resolve();
      signal.throwIfAborted();
      if (fails(group)) throw new Error('lost');
      return partOf(partsIn(index, group)[part].splats);
    },
    onArrival: () => undefined,
    onError: (error) => errors.push(error),
  });
  const settle = async (): Promise<void> => {
    for (let k = 0; k < 200; k++) await Promise.resolve();
  };
  return { cache, asked, errors, settle };
}

test('coarse before fine, and the next group before a fine image of this one', async () => {
  const { cache, asked, settle } = bench(clip(20));
  cache.want(3, false);
  await settle();
  assert.deepEqual(asked.slice(0, 4), ['3.0', '4.0', '3.1', '4.1']);
  assert.equal(asked.length, new Set(asked).size, 'nothing is asked for twice');
  assert.ok(!asked.some((each) => each.startsWith('12.')), 'nothing far ahead');
});

test('played backward, the group before is the next one', async () => {
  const { cache, asked, settle } = bench(clip(20));
  cache.want(3, false, -1);
  await settle();
  assert.deepEqual(asked.slice(0, 4), ['3.0', '2.0', '3.1', '2.1']);
  assert.ok(!asked.some((each) => each.startsWith('4.')), 'nothing behind');
});

test('at the end of a loop the beginning is fetched', async () => {
  for (const loops of [true, false]) {
    const { cache, asked, settle } = bench(clip(20));
    cache.want(19, loops);
    await settle();
    assert.equal(asked.includes('0.0'), loops);
  }
});

test('an hour of play holds no more than a minute', { skip: onlyInLab }, async () => {
  const { cache, settle } = bench(clip(3600));
  let [minute, hour] = [0, 0];
  for (let group = 0; group < 3600; group++) {
    cache.want(group, false);
    await settle();
    assert.ok(cache.get(group, 0) && cache.get(group, 1), `group ${group} is there`);
    // All groups before, now and then; otherwise those of the last seconds.
    const oldest = group % 60 === 0 ? 0 : Math.max(0, group - 2 * MAX_HELD);
    const before = Array.from({ length: group - oldest }, (_, k) => oldest + k);
    const behind = before.filter((k) => cache.get(k, 0) ?? cache.get(k, 1));
    assert.ok(cache.held <= MAX_HELD, `${cache.held} groups at ${group}`);
    assert.ok((behind[0] ?? group) > group - MAX_HELD, `${behind.join()} at ${group}`);
    if (group < 60) minute = Math.max(minute, cache.held);
    else hour = Math.max(hour, cache.held);
  }
  assert.ok(hour <= minute, `${hour} groups, ${minute} in the first minute`);
});

test('a short clip that loops is fetched once', async () => {
  const { cache, asked, settle } = bench(clip(4));
  for (let round = 0; round < 10; round++) {
    for (let group = 0; group < 4; group++) {
      cache.want(group, true);
      await settle();
    }
  }
  assert.equal(asked.length, 8);
});

test('a seek gives up what is on its way', async () => {
  const index = clip(40);
  const signals: AbortSignal[] = [];
  const cache = new GroupCache(index, {
    fetchPart: (_group, _part, signal) => {
      signals.push(signal);
      return new Promise((_, reject) => signal.addEventListener('abort', () => reject(signal.reason as Error)));
    },
    onArrival: () => undefined,
    onError: () => assert.fail('nothing went wrong'),
  });
  cache.want(0, false);
  cache.want(30, false);
  assert.deepEqual(
    signals.map(({ aborted }) => aborted),
    [true, false],
  );
  cache.close();
  assert.ok(signals[1].aborted);
});

test('a seek does not wait for a part that is on its way and needed later', () => {
  const asked: string[] = [];
  const cache = new GroupCache(clip(4), {
    fetchPart: (group, part, signal) => {
      asked.push(`${group}.${part}`);
      return new Promise((_, reject) => signal.addEventListener('abort', () => reject(signal.reason as Error)));
    },
    onArrival: () => undefined,
    onError: () => assert.fail('nothing went wrong'),
  });
  // All groups are needed from each of them in a loop.
  cache.want(0, true);
  cache.want(2, true);
  assert.deepEqual(asked, ['0.0', '2.0']);
  cache.want(2, false);
  assert.deepEqual(asked, ['0.0', '2.0'], 'the needed part is not begun again');
  cache.close();
});

test('what cannot be had is reported once, and passed over', async () => {
  const { cache, errors, asked, settle } = bench(clip(8), (group) => group === 1);
  cache.want(0, false);
  await settle();
  assert.ok(cache.isMissing(1, 0) && !cache.get(1, 0));
  assert.ok(cache.get(2, 0), 'the group after it is there');
  cache.want(1, false);
  cache.want(1, false);
  await settle();
  assert.equal(asked.filter((each) => each === '1.0').length, 1);
  assert.equal(errors.length, 1);
});

test('of groups of a single frame, at 1,000 frames a second, some hundreds are fetched ahead', async () => {
  const part = { splats: 1, planes: 1, sceneBytes: 1, motionBytes: 1, start: 0 };
  const groups = Array.from({ length: 7_000 }, (_, first) => ({ first, frames: 1, parts: [part] }));
  const { cache, asked, settle } = bench({ framesPerSecond: 1_000, groups, still: [] } as unknown as ClipIndex);
  cache.want(0, true);
  for (let before = -1; asked.length > before;) {
    before = asked.length;
    await settle();
  }
  assert.ok(asked.length > 100 && asked.length < 500, `${asked.length} groups`);
});

test('parts that never change are fetched once, before the first group, and stay', async () => {
  const index = clip(60, [20_000, 100_000]);
  const { cache, asked, settle } = bench(index);
  assert.equal(cache.canShow(0), false);
  await cache.first(0, new AbortController().signal);
  assert.deepEqual(asked, ['-1.0', '0.0']);
  assert.equal(cache.canShow(0), true);
  for (const group of [0, 1, 2, 30, 59, 0, 40]) {
    cache.want(group, true);
    await settle();
    assert.ok(cache.canShow(group), `group ${group}`);
    assert.ok(cache.held <= MAX_HELD, `${cache.held} groups`);
  }
  assert.deepEqual(
    asked.filter((each) => each.startsWith('-1')),
    ['-1.0', '-1.1'],
  );
});
