import type { Variants } from '../variants.js';

/** Where a choice is kept between visits: `localStorage`, or anything like it. */
export interface AutotuneStore {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
}

/** Changes whenever a variant does, so that old choices are made anew. */
const VERSION = 4;

/** What a choice is kept under: the adapter and what it can do. */
export function keyFor(device: GPUDevice): string {
  const { vendor = '', architecture = '', device: model = '', description = '' } = device.adapterInfo ?? {};
  const features = [...device.features].sort().join(' ');
  return `gaussian-splat ${VERSION} ${[vendor, architecture, model, description].join(' ')} ${features}`;
}

/** Where pages keep theirs; null where they have or may use none. */
export function pageStore(): AutotuneStore | null {
  try {
    return (globalThis as { localStorage?: AutotuneStore }).localStorage ?? null;
  } catch {
    // A page may be denied its storage.
    return null;
  }
}

/** The choice of an earlier visit; undefined where there is none that this device can have. */
export function readChoice(store: AutotuneStore | null, device: GPUDevice): Variants | undefined {
  try {
    const { rasterizer, accumulation, threads } = JSON.parse(
      store?.getItem(keyFor(device)) ?? '{}',
    ) as Partial<Variants>;
    const isKnown =
      (rasterizer === 'quads' || rasterizer === 'tiles') &&
      (accumulation === 'rgba16float' || accumulation === 'rgba32float') &&
      (threads === 'parallel' || threads === 'serial');
    return isKnown ? { rasterizer, accumulation, threads } : undefined;
  } catch {
    return undefined;
  }
}

export function writeChoice(store: AutotuneStore | null, key: string, variants: Variants): void {
  try {
    store?.setItem(key, JSON.stringify(variants));
  } catch {
    // A full or forbidden store costs the next visit its own search.
  }
}
