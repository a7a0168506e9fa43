/** Loading a large scene: what can be seen early, and what the page notices of it. */
import { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, delay } from './support/harness.js';

const SCENE = '/net/shared/scenes/playbot-streamed/0_0/meta.json';

/** The longest task of the page's own thread, ms; those under 50 ms are not told. */
function watchThread(): () => Promise<number> {
  let longest = 0;
  const observer = new PerformanceObserver((list) => {
    for (const { duration } of list.getEntries()) longest = Math.max(longest, duration);
  });
  observer.observe({ entryTypes: ['longtask'] });
  return async () => {
    // Entries come some time after the task.
    await delay(500);
    observer.disconnect();
    return longest;
  };
}

describe('a scene of 500,000 splats', () => {
  it('shows a preview within a third of the time, and never blocks the page', async function () {
    if (!(await fetch(SCENE)).ok) return this.skip();
    const loader = GaussianSplatElement.sceneLoader;
    const url = new URL(SCENE, location.href).href;
    const request = { url, credentials: 'same-origin', sh: 'auto' } as const;
    // The worker and its readers are there before the clock starts, as in a page that loads its second scene.
    const small = new URL('/tests/element/browser/fixtures/compass.ply', location.href).href;
    await loader.load({ ...request, url: small }, new AbortController().signal, () => undefined);
    // The best of three: other work on the machine comes and goes.
    let best = { share: Infinity, longestTask: Infinity };
    for (let round = 0; round < 3 && !(best.share <= 1 / 3 && best.longestTask < 50); round++) {
      const longestTask = watchThread();
      const start = performance.now();
      let first = Infinity;
      const scene = await loader.load(
        request,
        new AbortController().signal,
        () => undefined,
        () => (first = Math.min(first, performance.now() - start)),
      );
      const total = performance.now() - start;
      assert(scene.packed.count === 500_000, 'all splats');
      best = { share: first / total, longestTask: await longestTask() };
      console.log(
        `first preview after ${first.toFixed(0)} of ${total.toFixed(0)} ms; ` +
          `longest task of the page ${best.longestTask < 50 ? 'under 50' : best.longestTask.toFixed(0)} ms`,
      );
    }
    assert(best.share <= 1 / 3, `a preview after ${best.share} of the time`);
    assert(best.longestTask < 50, `a task of ${best.longestTask} ms on the page's thread`);
  });
});
