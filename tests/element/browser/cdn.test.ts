import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, COMPASS, nextEvent, show } from './support/harness.js';
import { isRed, screenOf } from './support/screen.js';

/** Scripts of all workers that the page has started. */
const workers: string[] = [];
window.Worker = class extends Worker {
  constructor(script: string | URL, options?: WorkerOptions) {
    super(script, options);
    workers.push(String(script));
  }
};

describe('the CDN build', () => {
  it('from another origin finds its worker and its readers', async () => {
    const origin = await (await fetch('/net/other-origin')).text();
    const { GaussianSplatElement: Class } = (await import(`${origin}/cdn/gaussian-splat.min.js`)) as {
      GaussianSplatElement: typeof GaussianSplatElement;
    };
    assert(customElements.get('gaussian-splat') === Class, "the element is the build's");
    for (const src of [COMPASS, COMPASS.replace('.splat', '.ply')]) {
      const element = show({ src });
      await element.ready;
      assert(element.loaded, element.error?.message ?? 'not loaded');
      assert((await screenOf(element)).middleOf(isRed), 'the scene is seen');
    }
    assert(workers.length === 1 && workers[0].startsWith('blob:'), `one worker by way of a blob: ${workers.join(' ')}`);
  });

  it('on a page that refuses workers and inline styles reads on the main thread, with one warning', async () => {
    const frame = document.createElement('iframe');
    const answer = nextEvent<MessageEvent<Record<string, unknown>>>(window, 'message');
    frame.src = '/net/strict-page';
    frame.style.cssText = 'width: 400px; height: 300px';
    document.body.append(frame);
    const { data } = await answer;
    assertEqual([data.loaded, data.error], [true, undefined], 'loaded');
    assertEqual((data.warnings as string[]).length, 1, `warnings ${JSON.stringify(data.warnings)}`);
    assert(/worker-src/.test(String(data.warnings)), String(data.warnings));
    assertEqual(data.violations, ['worker-src'], 'violations of the policy');
  });
});
