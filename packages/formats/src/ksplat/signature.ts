import { viewOf } from '../bytes.js';

/** Bytes of the header of a file; those of its sections follow. */
export const HEADER_BYTES = 4096;

/** True if the first bytes are those of mkkellogg's SplatBuffer: version 0.1, counts and level within their ranges. */
export function looksLikeKsplat(bytes: Uint8Array): boolean {
  if (bytes.length < HEADER_BYTES || bytes[0] !== 0 || bytes[1] !== 1) return false;
  const view = viewOf(bytes);
  const [maxSections, sections, maxSplats, splats] = [4, 8, 12, 16].map((at) => view.getUint32(at, true));
  return sections >= 1 && sections <= maxSections && splats <= maxSplats && view.getUint16(20, true) <= 2;
}
