/** The latest request wins: earlier requests have no more effect, and their failures are ignored. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { LatestTask } from '../support/element/parts.js';

const settled = (): Promise<void> => new Promise(setImmediate);

test('a request ends the one before, whose failure is not heard of; its own is', async () => {
  const task = new LatestTask();
  const heard: string[] = [];
  const signals: AbortSignal[] = [];
  const ask = (name: string): void =>
    task.run(
      async (signal) => {
        signals.push(signal);
        await settled();
        throw new Error(name);
      },
      (error) => heard.push((error as Error).message),
    );
  ask('first');
  ask('second');
  assert.deepEqual(
    signals.map(({ aborted }) => aborted),
    [true, false],
  );
  assert.equal(task.signal, signals[1]);
  await settled();
  await settled();
  assert.deepEqual(heard, ['second']);
});

test('what is given up is given up in silence', async () => {
  const task = new LatestTask();
  task.run(
    async (signal) => {
      await settled();
      signal.throwIfAborted();
    },
    () => assert.fail('heard of'),
  );
  task.renew();
  await settled();
  await settled();
  assert.equal(task.signal.aborted, false);
});
