/** Files that several frames of a sequence need are read once, for as long as one of them waits, and released if they are large. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { SharedReads } from '@gaussian-splat/core/fetch';

const never = new AbortController().signal;

test('it is read once for all that ask, then and later', async () => {
  const reads = new SharedReads<string>(() => 10);
  let times = 0;
  const read = async (): Promise<string> => {
    times++;
    await Promise.resolve();
    return 'bytes';
  };
  assert.deepEqual(await Promise.all([1, 2, 3].map(() => reads.read('a', read, never))), Array(3).fill('bytes'));
  assert.deepEqual([await reads.read('a', read, never), times], ['bytes', 1]);
  await reads.read('b', read, never);
  assert.equal(times, 2);
});

test('one canceled reader leaves it to the others; the last one ends it, and the next reads again', async () => {
  const reads = new SharedReads<string>(() => 10);
  const signals: AbortSignal[] = [];
  const finish: ((value: string) => void)[] = [];
  const read = (signal: AbortSignal): Promise<string> => {
    signals.push(signal);
    return new Promise((resolve) => finish.push(resolve));
  };
  const [one, two] = [new AbortController(), new AbortController()];
  const waiting = [one, two].map(({ signal }) => reads.read('a', read, signal));
  one.abort(new Error('one'));
  await assert.rejects(waiting[0], /one/);
  assert.equal(signals[0].aborted, false);
  two.abort(new Error('two'));
  await assert.rejects(waiting[1], /two/);
  assert.equal(signals[0].aborted, true);
  const again = reads.read('a', read, never);
  assert.equal(signals.length, 2);
  finish[1]('bytes');
  assert.equal(await again, 'bytes');
});

test('what failed is read again, and of what takes much the one used last is kept', async () => {
  const reads = new SharedReads<number>((bytes) => bytes);
  await assert.rejects(
    reads.read('a', () => Promise.reject(new Error('gone')), never),
    /gone/,
  );
  assert.equal(await reads.read('a', () => Promise.resolve(100e6), never), 100e6);
  assert.equal(await reads.read('b', () => Promise.resolve(90e6), never), 90e6);
  let times = 0;
  const count = (): Promise<number> => Promise.resolve(100e6 + times++);
  assert.equal(await reads.read('b', count, never), 90e6);
  assert.equal(await reads.read('a', count, never), 100e6);
  assert.equal(times, 1);
});
