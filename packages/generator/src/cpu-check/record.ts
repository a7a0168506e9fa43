import type { GeneratorModel } from '../runtime/open-model.js';

/** Result of comparing a model's run on the GPU with its run on the CPU. */
export interface CpuCheckResult {
  /** Outcome of the comparison; `unknown` if nothing could be compared. */
  readonly result: 'same' | 'different' | 'unknown';
  /**
   * Largest difference of the least accurate attribute, as a fraction of its largest value; absent if nothing was
   * compared.
   */
  readonly error?: number;
  /** Reason of the result, in English, for display without a full stop. */
  readonly reason: string;
}

/** Part of the storage key. It changes with the version of the runtime and with the tolerances. */
const VERSION = 'ort 1.30.0, 2';

/**
 * Returns the storage key of a result: a digest of the model's bytes, and the adapter. Undefined if the page cannot
 * compute digests.
 */
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

/** Returns the stored result of an earlier visit; undefined if there is none. */
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

/** Returns the storage of the page. Access may throw, because a page may be denied its storage. */
const pageStore = (): Storage | undefined => (globalThis as { localStorage?: Storage }).localStorage;
