/**
 * Signatures of formats, and the number of leading bytes for testing them. Signatures of other files:
 * foreign-signatures.ts.
 */
import { asciiOf, isJsonObject, startsWith, viewOf } from './bytes.js';

/** Headers of splat files have 1 to 5 KB; the end of a header is not searched beyond this length. */
export const MAX_HEADER_BYTES = 262_144;
/**
 * Length of the first search, because decoding a quarter of a megabyte of text takes longer than reading some thousand
 * splats.
 */
export const USUAL_HEADER_BYTES = 16_384;

/** Text that distinguishes a compressed PLY from a plain one; it is within the first lines of every such header. */
const COMPRESSED_PLY_MARK = /[\r\n]property[ \t]+\S+[ \t]+packed_position\s/;

export const isPly = (bytes: Uint8Array): boolean =>
  /^(\u00ef\u00bb\u00bf)?ply[ \t]*[\r\n]/.test(asciiOf(bytes, 0, 16));
export const isCompressedPly = (bytes: Uint8Array): boolean => {
  if (!isPly(bytes)) return false;
  const [header, isWhole] = [asciiOf(bytes, 0, USUAL_HEADER_BYTES), /[\r\n]end_header\s/];
  return COMPRESSED_PLY_MARK.test(isWhole.test(header) ? header : asciiOf(bytes, 0, MAX_HEADER_BYTES));
};
/** Also tests the compression method and reserved flags, because a `.splat` may begin with the first two bytes. */
export const isGzip = (bytes: Uint8Array): boolean => startsWith(bytes, [0x1f, 0x8b, 8]) && (bytes[3] & 0xe0) === 0;
/**
 * Tests for JSON with a unique key. Keys come in any order, and one may have megabytes (buffers of glTF); therefore
 * long samples of both ends are searched.
 */
export const isJsonWith =
  (key: RegExp) =>
  (bytes: Uint8Array): boolean =>
    isJsonObject(bytes) && key.test(asciiOf(bytes, 0, USUAL_HEADER_BYTES) + asciiOf(bytes, -USUAL_HEADER_BYTES));
export const isLodMeta = isJsonWith(/"(lodLevels|filenames)"\s*:/);
export const isSogMeta = isJsonWith(/"means"\s*:/);
export const isGltf = isJsonWith(/"(asset|bufferViews)"\s*:\s*[[{]/);
/** A file; an empty archive; and multi-volume archives with a single volume. */
const ZIP_STARTS = ['PK\x03\x04', 'PK\x05\x06', 'PK00PK\x03\x04', 'PK\x07\x08PK\x03\x04'];
export const isZip = (bytes: Uint8Array): boolean => ZIP_STARTS.some((start) => startsWith(bytes, start));
/** A scene of Spark, or a chunk of one. */
export const isRad = (bytes: Uint8Array): boolean => startsWith(bytes, 'RAD0') || startsWith(bytes, 'RADC');
export const isNgsp = (bytes: Uint8Array): boolean => startsWith(bytes, 'NGSP');

/** Bytes of the header of a `.ksplat`; those of its sections follow. */
export const KSPLAT_HEADER_BYTES = 4096;

/** Whether the first bytes are those of mkkellogg's SplatBuffer: version 0.1, counts and level within their ranges. */
export function looksLikeKsplat(bytes: Uint8Array): boolean {
  if (bytes.length < KSPLAT_HEADER_BYTES || bytes[0] !== 0 || bytes[1] !== 1) return false;
  const view = viewOf(bytes);
  const [maxSections, sections, maxSplats, splats] = [4, 8, 12, 16].map((at) => view.getUint32(at, true));
  return sections >= 1 && sections <= maxSections && splats <= maxSplats && view.getUint16(20, true) <= 2;
}

/** Larger files cannot be the manifest of a sequence. */
export const MAX_MANIFEST_BYTES = 1 << 24;

/** Whether a file is the manifest of a sequence. */
export function isSequence(bytes: Uint8Array): boolean {
  if (bytes.length > MAX_MANIFEST_BYTES || !isJsonObject(bytes)) return false;
  try {
    return 'gaussianSplatSequence' in (JSON.parse(new TextDecoder().decode(bytes)) as object);
  } catch {
    return false;
  }
}
