/** The loop of runs, with a queue that finishes at once: nothing that is asked for is forgotten. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setImmediate } from 'node:timers/promises';
import { RunLoop } from '../../packages/generator/src/run-loop.js';

const queue = { onSubmittedWorkDone: () => Promise.resolve() } as unknown as GPUQueue;

test('what is asked for however many microtasks after another request is run', async () => {
  for (const first of ['due', 'not due']) {
    for (let later = 0; later < 16; later++) {
      const runs: string[] = [];
      const loop = new RunLoop<string>({
        queue,
        isDue: (request) => request !== 'not due',
        run: (request) => Promise.resolve(void runs.push(request)),
        onError: (error) => assert.fail(String(error)),
      });
      loop.request(first);
      for (let i = 0; i < later; i++) await undefined;
      loop.request('last');
      await setImmediate();
      assert.equal(runs.at(-1), 'last', `${first}, then after ${later} microtasks`);
      assert.equal(loop.isBusy, false);
    }
  }
});
