import type { Variants } from '../variants.js';

/** Storage of autotuning results between visits: `localStorage`, or an object with the same methods. */
export interface AutotuneStore {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
}

/** Incremented whenever a variant changes, to invalidate stored results. */
const VERSION = 4;

/** Storage key: the adapter and its capabilities. */
export function keyFor(device: GPUDevice): string {
  const { vendor = '', architecture = '', device: model = '', description = '' } = device.adapterInfo ?? {};
  const features = [...device.features].sort().join(' ');
  return `gaussian-splat ${VERSION} ${[vendor, architecture, model, description].join(' ')} ${features}`;
}

/** The default storage of a page; null if it has none or may not use it. */
export function pageStore(): AutotuneStore | null {
  try {
    return (globalThis as { localStorage?: AutotuneStore }).localStorage ?? null;
  } catch {
    // The page may be denied its storage.
    return null;
  }
}

/** Returns the result of an earlier visit; undefined if there is none that this device supports. */
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
