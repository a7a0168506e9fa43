/** S18 in the page: sizes at random, none at all, hidden pages and moved elements; see ../extreme-image-sizes.ts. */
import '@gaussian-splat/element';
import { assert, assertEqual, devices, frames, showLoaded, until } from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { random, sized } from './support.js';

describe('S18: resize', () => {
  it('hundreds of sizes, 0 x 0 among them, end with the frame of a fresh start', async () => {
    const element = await showLoaded({ 'interpolation-decay': '0' });
    const fresh = await screenOf(element);
    const messages: string[] = [];
    devices.at(-1)?.addEventListener('uncapturederror', ({ error }) => messages.push(error.message));
    for (let step = 0; step < sized(60, 1000); step++) {
      const kind = random();
      if (kind < 0.1) element.style.display = 'none';
      else if (kind < 0.2) element.style.cssText = 'display: block; width: 0; height: 0';
      else if (kind < 0.25) element.style.cssText = 'display: block; width: 1px; height: 1px';
      else if (kind < 0.3) document.body.append(element);
      else
        element.style.cssText = `display: block; width: ${Math.floor(500 * random())}px; height: ${Math.floor(400 * random())}px`;
      // Some changes come within one frame, others are drawn.
      if (random() < 0.5) await frames(1);
    }
    element.style.cssText = 'width: 120px; height: 100px';
    const canvas = element.shadowRoot?.querySelector('canvas');
    await until(() => canvas?.width === 120 && canvas.height === 100, 'the first size');
    assertEqual((await screenOf(element)).differences(fresh), 0, 'differing color values');
    assertEqual(messages, [], 'errors of the device');
    assert(element.loaded && element.error === null, 'loaded');
  });
});
