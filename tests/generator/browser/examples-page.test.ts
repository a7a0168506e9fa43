/** The page of trained examples as it is built: each runs on the GPU, is drawn, tells its cost, and follows its handles. */
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, nextEvent, until } from '../../element/browser/support/harness.js';

/** SwiftShader decodes 80,000 Gaussians a run. */
const PATIENCE_MS = 100_000;
const GAUSSIANS = { plant: 30_000, walker: 40_000, skull: 79_995 };

let page: Document;

before(async () => {
  const frame = document.createElement('iframe');
  frame.src = '/demo/dist/examples/index.html';
  frame.style.cssText = 'width: 260px; height: 200px';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  page = frame.contentDocument!;
});

/** Brings an example into sight, and waits until it is on show. */
async function open(name: string): Promise<{ card: HTMLElement; element: GaussianSplatElement; fallbacks: string[] }> {
  const card = page.querySelector<HTMLElement>(`[data-example="${name}"]`)!;
  const element = card.querySelector<GaussianSplatElement>('gaussian-splat')!;
  const fallbacks: string[] = [];
  element.addEventListener('generator-fallback', (event) =>
    fallbacks.push(String((event as CustomEvent).detail.reason)),
  );
  card.scrollIntoView();
  await until(() => element.loaded || element.error !== null, `${name} on show`, PATIENCE_MS);
  assertEqual(element.error?.message, undefined, name);
  await until(() => card.querySelector('.cost')!.childElementCount > 0, `${name}: its cost`);
  return { card, element, fallbacks };
}

/** Pixels of the element's canvas that anything was drawn on, and a sum that changes with the picture. */
async function pictureOf(element: GaussianSplatElement): Promise<{ covered: number; sum: number }> {
  const canvas = element.shadowRoot!.querySelector('canvas')!;
  const bitmap = await createImageBitmap(canvas);
  const copy = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
  copy.drawImage(bitmap, 0, 0);
  const { data } = copy.getImageData(0, 0, bitmap.width, bitmap.height);
  let [covered, sum] = [0, 0];
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 0) covered++;
    sum = (sum * 31 + data[i] + data[i + 3]) % 1_000_003;
  }
  return { covered: covered / (data.length / 4), sum };
}

/** Waits until the picture is another one. */
async function changes(element: GaussianSplatElement, act: () => void, what: string): Promise<void> {
  const before = (await pictureOf(element)).sum;
  act();
  const deadline = performance.now() + PATIENCE_MS;
  while ((await pictureOf(element)).sum === before) {
    assert(performance.now() < deadline, `${what}: the picture is still the same`);
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
}

const slide = (card: HTMLElement, selector: string, value: number): void => {
  const slider = card.querySelector<HTMLInputElement>(selector)!;
  slider.value = String(value);
  slider.dispatchEvent(new Event('input', { bubbles: true }));
};

describe('the page of trained examples', () => {
  for (const [name, gaussians] of Object.entries(GAUSSIANS)) {
    it(`${name} runs on the GPU, is drawn, and tells what it costs`, async () => {
      const { card, element, fallbacks } = await open(name);
      assertEqual([element.statistics?.splats, fallbacks], [gaussians, []]);
      const { covered } = await pictureOf(element);
      assert(covered > 0.02 && covered < 0.9, `${covered} of the pixels are covered`);
      const words = card.querySelector('.cost')!.textContent!;
      for (const part of [' MB', gaussians.toLocaleString('en'), ' dB', 'NVIDIA H200', 'Licence']) {
        assert(words.includes(part), `${part} in ${words}`);
      }
    }).timeout(PATIENCE_MS);
  }

  it('the plant follows its time, the walker its pose and shape', async () => {
    const plant = await open('plant');
    await changes(plant.element, () => slide(plant.card, '[data-time]', 2.5), 'time');
    assertEqual([plant.element.currentTime, plant.element.duration], [2.5, 6]);
    const walker = await open('walker');
    await changes(walker.element, () => slide(walker.card, '[data-handle="arms"]', 1), 'arms');
    await changes(walker.element, () => slide(walker.card, '[data-shape]', 0.8), 'shape');
  }).timeout(PATIENCE_MS);

  it('the post-processor, which writes no Gaussians, tells its cost beside its picture', async () => {
    const card = page.querySelector<HTMLElement>('[data-example="oil"]')!;
    await until(() => card.querySelector('.cost')!.childElementCount > 0, 'its cost');
    const words = card.querySelector('.cost')!.textContent!;
    assert(words.includes('0.09 MB') && words.includes('28.2 dB') && !words.includes('Gaussians'), words);
    const picture = card.querySelector('img')!;
    await picture.decode();
    assert(picture.naturalWidth > 100, 'its picture');
  });
});
