/** The page of trained examples as it is built. Each has a test file of its own: SwiftShader on a busy machine is slow. */
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, nextEvent, until } from '../../../element/browser/support/harness.js';

const PATIENCE_MS = 200_000;

async function openPage(): Promise<Document> {
  const frame = document.createElement('iframe');
  frame.src = '/demo/dist/examples/index.html';
  frame.style.cssText = 'width: 260px; height: 200px';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  return frame.contentDocument!;
}

/** An example that is on show, and why it could not run on the GPU, if so. */
export interface OpenExample {
  readonly page: Document;
  readonly card: HTMLElement;
  readonly element: GaussianSplatElement;
  readonly fallbacks: readonly string[];
}

/** Opens the page, brings an example into sight, and waits until it is on show. */
export async function open(name: string): Promise<OpenExample> {
  const page = await openPage();
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
  return { page, card, element, fallbacks };
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
export async function changes(element: GaussianSplatElement, act: () => void, what: string): Promise<void> {
  const before = (await pictureOf(element)).sum;
  act();
  const deadline = performance.now() + PATIENCE_MS;
  while ((await pictureOf(element)).sum === before) {
    assert(performance.now() < deadline, `${what}: the picture is still the same`);
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
}

export const slide = (card: HTMLElement, selector: string, value: number): void => {
  const slider = card.querySelector<HTMLInputElement>(selector)!;
  slider.value = String(value);
  slider.dispatchEvent(new Event('input', { bubbles: true }));
};

/** Runs on the GPU, is drawn, and tells what it costs. */
export async function assertShown({ card, element, fallbacks }: OpenExample, gaussians: number): Promise<void> {
  assertEqual([element.statistics?.splats, fallbacks], [gaussians, []]);
  const { covered } = await pictureOf(element);
  assert(covered > 0.02 && covered < 0.9, `${covered} of the pixels are covered`);
  const words = card.querySelector('.cost')!.textContent!;
  for (const part of [' MB', gaussians.toLocaleString('en'), ' dB', 'NVIDIA H200', 'Licence']) {
    assert(words.includes(part), `${part} in ${words}`);
  }
}
