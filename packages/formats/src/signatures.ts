/**
 * Signatures of scene formats, and the number of bytes that their tests need. foreign-signatures.ts has the signatures
 * of other files.
 */
import { asciiOf, isJsonObject, startsWith, viewOf } from './bytes.js';

/** Maximum length of a text header in bytes. Headers of most splat files have 1 to 5 KB. */
export const MAX_HEADER_BYTES = 262_144;
/**
 * Number of bytes that are first searched for the end of a header. Decoding all {@link MAX_HEADER_BYTES} as text takes
 * longer than reading a few thousand splats.
 */
export const USUAL_HEADER_BYTES = 16_384;

/** Matches the property in the header of every compressed PLY that a plain PLY does not have. */
const COMPRESSED_PLY_MARK = /[\r\n]property[ \t]+\S+[ \t]+packed_position\s/;

export const isPly = (bytes: Uint8Array): boolean =>
  /^(\u00ef\u00bb\u00bf)?ply[ \t]*[\r\n]/.test(asciiOf(bytes, 0, 16));
export const isCompressedPly = (bytes: Uint8Array): boolean => {
  if (!isPly(bytes)) return false;
  const [header, isWhole] = [asciiOf(bytes, 0, USUAL_HEADER_BYTES), /[\r\n]end_header\s/];
  return COMPRESSED_PLY_MARK.test(isWhole.test(header) ? header : asciiOf(bytes, 0, MAX_HEADER_BYTES));
};
/** Tests the compression method and reserved flags, too, because a `.splat` file may begin with the magic number. */
export const isGzip = (bytes: Uint8Array): boolean => startsWith(bytes, [0x1f, 0x8b, 8]) && (bytes[3] & 0xe0) === 0;
/**
 * Returns a function that tests whether a file is a JSON object with a key. Keys have any order, and the value of one may
 * have megabytes, such as a buffer of glTF. Therefore only the first and the last 16,384 bytes are searched.
 */
export const isJsonWith =
  (key: RegExp) =>
  (bytes: Uint8Array): boolean =>
    isJsonObject(bytes) && key.test(asciiOf(bytes, 0, USUAL_HEADER_BYTES) + asciiOf(bytes, -USUAL_HEADER_BYTES));
export const isLodMeta = isJsonWith(/"(lodLevels|filenames)"\s*:/);
export const isSogMeta = isJsonWith(/"means"\s*:/);
export const isGltf = isJsonWith(/"(asset|bufferViews)"\s*:\s*[[{]/);
/** First bytes of a ZIP archive: of a file, of an empty archive, or of a split archive with one volume. */
const ZIP_STARTS = ['PK\x03\x04', 'PK\x05\x06', 'PK00PK\x03\x04', 'PK\x07\x08PK\x03\x04'];
export const isZip = (bytes: Uint8Array): boolean => ZIP_STARTS.some((start) => startsWith(bytes, start));
/** Whether a file is a RAD scene of Spark, or a chunk of one. */
export const isRad = (bytes: Uint8Array): boolean => startsWith(bytes, 'RAD0') || startsWith(bytes, 'RADC');
export const isNgsp = (bytes: Uint8Array): boolean => startsWith(bytes, 'NGSP');

/** Size in bytes of the first header of a `.ksplat` file. The headers of its sections follow. */
export const KSPLAT_HEADER_BYTES = 4096;

/** Whether a file begins as mkkellogg's SplatBuffer: version 0.1, with counts and compression level in valid ranges. */
export function looksLikeKsplat(bytes: Uint8Array): boolean {
  if (bytes.length < KSPLAT_HEADER_BYTES || bytes[0] !== 0 || bytes[1] !== 1) return false;
  const view = viewOf(bytes);
  const [maxSections, sections, maxSplats, splats] = [4, 8, 12, 16].map((at) => view.getUint32(at, true));
  return sections >= 1 && sections <= maxSections && splats <= maxSplats && view.getUint16(20, true) <= 2;
}

/** Maximum size in bytes of the manifest of a sequence. */
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
