import type { GeneratorModel } from '../runtime/open-model.js';

/** What comparing a model's run on the GPU with its run on the CPU has shown. */
export interface Verdict {
  /** `unknown` where there was nothing to compare with. */
  readonly result: 'same' | 'different' | 'unknown';
  /** Largest difference, as a share of the largest value of what differs most; absent where nothing was compared. */
  readonly error?: number;
  /** For readers, without a full stop. */
  readonly reason: string;
}

/** Changes with the version of the runtime, and with what counts as different. */
const VERSION = 'ort 1.30.0, 1';

/** What a verdict is kept under: the bytes of the model, and the adapter. Undefined where a page may not digest. */
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

/** The verdict of an earlier visit. */
export function readRecord(key: string | undefined): Verdict | undefined {
  try {
    const verdict = JSON.parse(pageStore()?.getItem(key ?? '') ?? 'null') as Verdict | null;
    const isKnown = ['same', 'different', 'unknown'].includes(verdict?.result ?? '');
    return key !== undefined && isKnown && typeof verdict?.reason === 'string' ? verdict : undefined;
  } catch {
    return undefined;
  }
}

export function writeRecord(key: string | undefined, verdict: Verdict): void {
  try {
    if (key !== undefined) pageStore()?.setItem(key, JSON.stringify(verdict));
  } catch {
    // A full or forbidden store costs the next visit a comparison of its own.
  }
}

/** Reading it may throw: a page may be denied its storage. */
const pageStore = (): Storage | undefined => (globalThis as { localStorage?: Storage }).localStorage;
