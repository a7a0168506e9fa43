import { isJsonObject } from './bytes.js';

/** Larger files are no manifest of a sequence, whatever they begin with. */
export const MAX_MANIFEST_BYTES = 1 << 24;

/** True if a file is the manifest of a sequence. */
export function isSequence(bytes: Uint8Array): boolean {
  if (bytes.length > MAX_MANIFEST_BYTES || !isJsonObject(bytes)) return false;
  try {
    return 'gaussianSplatSequence' in (JSON.parse(new TextDecoder().decode(bytes)) as object);
  } catch {
    return false;
  }
}
