import type { GeneratorModel } from '../runtime/open-model.js';

/** Result of comparing a model's run on the GPU with its run on the CPU. */
export interface CpuCheckResult {
  /** `unknown` if there was nothing to compare with. */
  readonly result: 'same' | 'different' | 'unknown';
  /**
   * Largest difference, as a fraction of the largest value of the least accurate attribute; absent if nothing was
   * compared.
   */
  readonly error?: number;
  /** For display, without a full stop. */
  readonly reason: string;
}

/** Depends on the version of the runtime, and on the tolerances. */
const VERSION = 'ort 1.30.0, 1';

/** Storage key of a result: the bytes of the model, and the adapter. Undefined if the page cannot compute digests. */
export async function recordKey(
  { bytes, externalData }: GeneratorModel,
  device: GPUDevice,
): Promise<string | undefined> {
  const { subtle } = (globalThis as { crypto?: Crypto }).crypto ?? {};
  if (subtle === undefined) return undefined;
  const parts = [bytes, ...externalData.map(({ data }) => data)];
  const digests = await Promise.all(parts.map((part) => subtle.digest('SHA-256', part as Uint8Array<ArrayBuffer>)));
  const hex = digests.flatMap((digest) =>
    Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, '0')),
  );
  const { vendor = '', architecture = '', device: model = '', description = '' } = device.adapterInfo ?? {};
  return `gaussian-splat proof ${VERSION} ${[vendor, architecture, model, description].join(' ')} ${hex.join('')}`;
}

/** Returns the result of an earlier visit. */
export function readRecord(key: string | undefined): CpuCheckResult | undefined {
  try {
    const verdict = JSON.parse(pageStore()?.getItem(key ?? '') ?? 'null') as CpuCheckResult | null;
    const isKnown = ['same', 'different', 'unknown'].includes(verdict?.result ?? '');
    return key !== undefined && isKnown && typeof verdict?.reason === 'string' ? verdict : undefined;
  } catch {
    return undefined;
  }
}

export function writeRecord(key: string | undefined, verdict: CpuCheckResult): void {
  try {
    if (key !== undefined) pageStore()?.setItem(key, JSON.stringify(verdict));
  } catch {
    // If the storage is full or forbidden, the next visit compares again.
  }
}

/** Access may throw, because a page may be denied its storage. */
const pageStore = (): Storage | undefined => (globalThis as { localStorage?: Storage }).localStorage;
