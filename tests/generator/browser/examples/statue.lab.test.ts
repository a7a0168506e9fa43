/**
 * The feed-forward example on its page: it waits for a click, shows its inputs, and reports its cost. At 256 x 256 pixels SwiftShader takes
 * minutes for a run, so the network itself runs in tests/generator/examples.alone.test.ts (the CPU, against a held-out image) and, small, in families.lab.test.ts
 * (the GPU).
 */
import { assert, assertEqual, until } from '../../../element/browser/support/harness.js';
import { openCard } from './support.js';

describe('the page of trained examples', () => {
  it('the statue waits for a click, with two images and the relation of their cameras', async () => {
    const { page, card, element } = await openCard('statue');
    const images = [...card.querySelectorAll<HTMLImageElement>('.given img')];
    await until(() => images.every(({ complete, naturalWidth }) => complete && naturalWidth === 256), 'pictures');
    const given = element.inputValues as Record<string, string | number[]>;
    assertEqual(Object.keys(given).sort(), ['focal_length', 'image', 'image_2', 'principal_point', 'relative_pose']);
    assertEqual(
      [given.image, given.image_2],
      images.map(({ src }) => src),
    );
    assertEqual((given.relative_pose as number[]).length, 16);
    const [statue, angel] = card.querySelectorAll<HTMLButtonElement>('[data-pair]');
    angel.click();
    await until(() => angel.getAttribute('aria-pressed') === 'true', 'the other pair');
    const other = element.inputValues as Record<string, string | number[]>;
    assert(String(other.image).endsWith('statue/angel/image.png'), String(other.image));
    assert(other.relative_pose.toString() !== given.relative_pose.toString(), 'another pose');
    assertEqual(statue.getAttribute('aria-pressed'), 'false');
    const words = card.querySelector('.cost')!.textContent!;
    for (const part of [' MB', '131,072', ' dB', 'a scene that it never saw', 'NVIDIA H200', 'License']) {
      assert(words.includes(part), `${part} in ${words}`);
    }
    element.scrollIntoView({ block: 'center' });
    await new Promise((resolve) => setTimeout(resolve, 300));
    const fetched = page.defaultView!.performance.getEntriesByType('resource').map(({ name }) => name);
    assert(!element.loaded && !fetched.some((name) => /ort-wasm/.test(name)), 'nothing runs before the click');
  });
});
