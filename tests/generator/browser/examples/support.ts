/** The page of trained examples as it is built. Each has a test file of its own: SwiftShader on a busy machine is slow. */
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, nextEvent, until } from '../../../element/browser/support/harness.js';
import { screenOf } from '../../../element/browser/support/screen.js';

const TIMEOUT_MS = 200_000;

async function openPage(): Promise<Document> {
  const frame = document.createElement('iframe');
  frame.src = '/demo/dist/examples/index.html';
  frame.style.cssText = 'position: fixed; inset: 0 auto auto 0; border: 0; width: 360px; height: 360px';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  return frame.contentDocument!;
}

/** A visible example, and the reason if it could not run on the GPU. */
export interface OpenExample {
  readonly page: Document;
  readonly card: HTMLElement;
  readonly element: GaussianSplatElement;
  readonly fallbacks: readonly string[];
}

/** Opens the page, and waits until an example reports its cost. */
export async function openCard(name: string): Promise<Omit<OpenExample, 'fallbacks'>> {
  const page = await openPage();
  const card = page.querySelector<HTMLElement>(`[data-example="${name}"]`)!;
  const element = card.querySelector<GaussianSplatElement>('gaussian-splat')!;
  await until(() => card.querySelector('.cost')!.childElementCount > 0, `${name}: its cost`);
  return { page, card, element };
}

/** Opens the page, scrolls to an example, and waits until it is visible. */
export async function open(name: string): Promise<OpenExample> {
  const { page, card, element } = await openCard(name);
  const fallbacks: string[] = [];
  element.addEventListener('generator-fallback', (event) =>
    fallbacks.push(String((event as CustomEvent).detail.reason)),
  );
  element.scrollIntoView({ block: 'center' });
  await until(() => element.loaded || element.error !== null, `${name} visible`, TIMEOUT_MS);
  assertEqual(element.error?.message, undefined, name);
  await until(() => card.querySelector('.cost')!.childElementCount > 0, `${name}: its cost`);
  // Cards above may have grown meanwhile.
  element.scrollIntoView({ block: 'center' });
  return { page, card, element, fallbacks };
}

/** Waits until another frame is visible. The page is at the window's corner: positions in both are the same. */
export async function changes(element: GaussianSplatElement, act: () => void, what: string): Promise<void> {
  const before = await screenOf(element);
  act();
  const deadline = performance.now() + TIMEOUT_MS;
  while ((await screenOf(element)).differences(before, 10) < 100) {
    assert(performance.now() < deadline, `${what}: the frame is still the same`);
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
}

export const slide = (card: HTMLElement, selector: string, value: number): void => {
  const slider = card.querySelector<HTMLInputElement>(selector)!;
  slider.value = String(value);
  slider.dispatchEvent(new Event('input', { bubbles: true }));
};

/** Runs on the GPU, is drawn, and reports its cost. */
export async function assertShown({ card, element, fallbacks }: OpenExample, gaussians: number): Promise<void> {
  // The element leaves models of images to the CPU on a software GPU.
  const others = fallbacks.filter((reason) => !/no hardware GPU/.test(reason));
  assertEqual([element.stats?.splats, others], [gaussians, []]);
  // The page behind is lighter than that.
  const dark = (await screenOf(element)).middleOf(([r, g, b]) => r + g + b < 560)?.count ?? 0;
  const covered = dark / (element.clientWidth * element.clientHeight);
  assert(covered > 0.01 && covered < 0.9, `${covered} of the pixels are covered`);
  const words = card.querySelector('.cost')!.textContent!;
  for (const part of [' MB', gaussians.toLocaleString('en'), ' dB', 'NVIDIA H200', 'License']) {
    assert(words.includes(part), `${part} in ${words}`);
  }
}
