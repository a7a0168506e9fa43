import type { Variants } from '../variants.js';

/** Storage of autotuning results between visits: `localStorage`, or an object with the same methods. */
export interface AutotuneStore {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
}

/** Version of the variants, which is incremented when a variant changes, so that stored results become invalid. */
const VERSION = 4;

/** Returns the storage key of a device: its adapter and its features. */
export function keyFor(device: GPUDevice): string {
  const { vendor = '', architecture = '', device: model = '', description = '' } = device.adapterInfo ?? {};
  const features = [...device.features].sort().join(' ');
  return `gaussian-splat ${VERSION} ${[vendor, architecture, model, description].join(' ')} ${features}`;
}

/** Returns the default storage of a page; null if the page has none or may not use it. */
export function pageStore(): AutotuneStore | null {
  try {
    return (globalThis as { localStorage?: AutotuneStore }).localStorage ?? null;
  } catch {
    // The browser may deny a page its storage.
    return null;
  }
}

/** Returns the result of an earlier visit; undefined without a valid result that this device supports. */
export function readStored(store: AutotuneStore | null, device: GPUDevice): Variants | undefined {
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

export function writeStored(store: AutotuneStore | null, key: string, variants: Variants): void {
  try {
    store?.setItem(key, JSON.stringify(variants));
  } catch {
    // If the storage is full or forbidden, the next visit searches again.
  }
}
