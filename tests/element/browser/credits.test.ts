/** The line of credits: from a file, from attributes, from children; its link, its place, and what it costs others. */
import '@gaussian-splat/element';
import type { Credits } from '@gaussian-splat/core';
import type { CreditsChangeDetail, GaussianSplatElement } from '@gaussian-splat/element';
import { changeFormat } from '@gaussian-splat/optimize';
import { smallCloud } from '../../formats/support/small-cloud.js';
import { ELEMENT_ONLY, violations } from './support/axe.js';
import { assert, assertEqual, COMPASS, nextEvent, showLoaded, until } from './support/harness.js';

const CREDITS = { attribution: 'City Museum <img src=x onerror=alert(1)>', license: 'CC-BY-NC-4.0' };
const SIZE = 'width: 320px; height: 200px';

async function fileWith(credits: Credits | undefined, name = 'a.ply'): Promise<string> {
  const { bytes } = await changeFormat({ ...smallCloud(40, 0), hints: { credits } }, { name });
  return `${URL.createObjectURL(new Blob([bytes as BlobPart]))}#${name}`;
}

const line = (element: GaussianSplatElement): HTMLElement | null => element.shadowRoot!.querySelector('[part=credits]');
// Browsers keep 250 entries unless they are asked for more; the element alone has that many modules here.
performance.setResourceTimingBufferSize(10_000);
const isLoaded = (): boolean => performance.getEntriesByType('resource').some(({ name }) => /credit-line/.test(name));

describe('credits', () => {
  it('load no code for a file without any', async () => {
    await showLoaded({ src: await fileWith(undefined) }, SIZE);
    assert(!isLoaded(), 'the code is not loaded');
  });

  it('of a file are shown as text, with a link to a license of Creative Commons, and reported', async () => {
    const element = document.createElement('gaussian-splat');
    const changed = nextEvent<CustomEvent<CreditsChangeDetail>>(element, 'credits-change');
    Object.assign(element, { src: await fileWith(CREDITS), alt: 'A vase' });
    element.style.cssText = SIZE;
    document.body.append(element);
    assertEqual((await changed).detail.credits, [CREDITS], 'reported');
    await until(() => line(element) !== null, 'the line');
    assertEqual(line(element)!.textContent, `${CREDITS.attribution}, ${CREDITS.license}`, 'text');
    assert(isLoaded(), 'by code that is now loaded');
    assertEqual(line(element)!.querySelector('img'), null, 'no markup of the file');
    assertEqual(line(element)!.querySelector('a')!.href, 'https://creativecommons.org/licenses/by-nc/4.0/');
    assertEqual(await violations(document, ELEMENT_ONLY), [], 'axe');
    const [box, own] = [element, line(element)!].map((each) => each.getBoundingClientRect());
    assertEqual([own.right, own.bottom], [box.right, box.bottom], 'corner');
    const gone = nextEvent<CustomEvent<CreditsChangeDetail>>(element, 'credits-change');
    element.src = COMPASS;
    assertEqual((await gone).detail.credits, [], 'after another file');
    await until(() => line(element) === null, 'no line');
    element.remove();
  });

  it('of attributes replace those of a file, and an empty one hides them', async () => {
    const element = await showLoaded({ src: await fileWith(CREDITS), attribution: 'Jane Doe' }, SIZE);
    await until(() => line(element)?.textContent === 'Jane Doe, CC-BY-NC-4.0', 'the name of the attribute');
    element.license = 'CC0-1.0';
    await element.updateComplete;
    assertEqual(line(element)!.querySelector('a')!.href, 'https://creativecommons.org/publicdomain/zero/1.0/');
    element.license = 'Only with permission';
    await element.updateComplete;
    assertEqual(line(element)!.querySelector('a'), null, 'no link');
    [element.attribution, element.license] = ['', ''];
    await element.updateComplete;
    assertEqual(line(element), null, 'hidden');
    [element.attribution, element.license] = [null, null];
    await element.updateComplete;
    assert(line(element)!.textContent.startsWith('City Museum'), 'those of the file again');
  });

  it('of children are shown once each, and content of the page takes their place', async () => {
    const [first, second] = [await fileWith(CREDITS, 'a.glb'), await fileWith({ attribution: 'Doe' }, 'b.spz')];
    const element = await showLoaded({ src: COMPASS, license: 'MIT' }, SIZE);
    element.innerHTML = [first, second, first].map((src) => `<splat-scene src="${src}"></splat-scene>`).join('');
    const expected = `MIT | ${CREDITS.attribution}, ${CREDITS.license} | Doe`;
    await until(() => line(element)?.textContent === expected, 'three credits');
    const own = Object.assign(document.createElement('p'), { slot: 'credits', textContent: 'See the catalog' });
    element.append(own);
    assertEqual([own.checkVisibility(), line(element)!.checkVisibility()], [true, false], 'in its place');
    own.remove();
    assert(line(element)!.checkVisibility(), 'the line again');
  });

  it('make room for buttons, and are drawn with WebGL 2 too', async () => {
    const webgl = { src: await fileWith(CREDITS), renderer: 'webgl', 'auto-rotate': '', 'auto-rotate-delay': '60000' };
    const element = await showLoaded(webgl, SIZE);
    await until(() => line(element) !== null, 'the line');
    const button = (): Element | null => element.shadowRoot!.querySelector('[part=pause-button]');
    await until(() => button() !== null, 'the button');
    const [own, other] = [line(element)!, button()!].map((each) => each.getBoundingClientRect());
    assert(own.bottom <= other.top || own.right <= other.left, 'they do not overlap');
  });

  it('are in saved PNG and JPEG images, which show the same pixels', async () => {
    const element = await showLoaded({ src: await fileWith(CREDITS), background: 'white' }, SIZE);
    await until(() => line(element) !== null, 'the line');
    for (const mimeType of ['image/png', 'image/jpeg']) {
      const image = await element.toBlob({ mimeType, background: 'white' });
      const [xmp] = /<x:xmpmeta.*<\/x:xmpmeta>/s.exec(await image.text()) ?? [''];
      const parsed = new DOMParser().parseFromString(xmp, 'text/xml');
      const texts = ['Credit', 'li'].map((name) => parsed.getElementsByTagNameNS('*', name)[0]?.textContent);
      const { attribution, license } = CREDITS;
      assertEqual(texts, [attribution, `${attribution}, ${license}`], mimeType);
      const plain = await createImageBitmap(await withoutCredits(element, mimeType));
      assertEqual(await pixelsOf(await createImageBitmap(image)), await pixelsOf(plain), 'pixels');
    }
    const webp = await element.toBlob({ mimeType: 'image/webp' });
    assert(!(await webp.text()).includes('xmpmeta'), 'other types have none');
  });
});

/** The same image while attributes hide the credits. */
async function withoutCredits(element: GaussianSplatElement, mimeType: string): Promise<Blob> {
  [element.attribution, element.license] = ['', ''];
  const image = await element.toBlob({ mimeType, background: 'white' });
  [element.attribution, element.license] = [null, null];
  assert(!(await image.text()).includes('xmpmeta'), 'no credits');
  return image;
}

async function pixelsOf(image: ImageBitmap): Promise<string> {
  const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, image.width, image.height);
  const digest = await crypto.subtle.digest('SHA-256', data);
  return `${image.width} ${image.height} ${new Uint8Array(digest).join()}`;
}
