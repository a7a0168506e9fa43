/** Identifies files that are not scenes, for error messages. This module is loaded after a file has been rejected. */
import { GaussianSplatError, type ErrorCode } from '@gaussian-splat/core';
import { asciiOf, grouped, quote } from './bytes.js';
import { foreignName, sampleText, type ForeignName } from './foreign-signatures.js';
import { UNREAD_KINDS, unreadKind, type UnreadKind } from './unsupported-formats.js';

/** A kind of file that is recognized only for an error message. */
interface ForeignKind {
  readonly code: ErrorCode;
  readonly found: string;
  readonly remedy: string;
  /** Whether the error message quotes the beginning of the file as text. */
  readonly isText?: boolean;
}

const CHECK_URL = 'check the address of the scene; the server sent something else';
const NOT_A_SCENE =
  'give the address of a scene file: .ply, .compressed.ply, .spz, .sog, .splat, .ksplat, .glb or .usdz';

const unread = ({ found, remedy }: UnreadKind): ForeignKind => ({
  code: 'decode/unsupported',
  found: `${found}, which is recognized but not supported`,
  remedy,
});
const foreign = (found: string, isText = false): ForeignKind => ({
  code: 'decode/unknown-format',
  found,
  remedy: NOT_A_SCENE,
  isText,
});

/** Kinds of files by the name of their signature. No scene format has one of these signatures. */
const SIGNED_KINDS: Readonly<Record<ForeignName, ForeignKind>> = {
  lfsPointer: {
    code: 'decode/lfs-pointer',
    found: 'a git-LFS pointer, which only names the real file',
    remedy: 'run "git lfs pull" where the file is served from, or use the address of the media file',
  },
  html: {
    code: 'decode/html',
    found: 'a web page (HTML)',
    remedy: `${CHECK_URL}, perhaps an error or login page`,
    isText: true,
  },
  xml: { ...foreign('an XML document, as storage servers send for missing or private files'), remedy: CHECK_URL },
  sequence: {
    code: 'decode/unsupported',
    found: 'the manifest of a sequence, which names many scenes',
    remedy: 'give it to the element or to gaussian-splat sequence; scripts read it with parseSequence',
  },
  json: foreign('a JSON text', true),
  png: foreign('a PNG image'),
  jpeg: foreign('a JPEG image'),
  webp: foreign('a WebP image'),
  gif: foreign('a GIF image'),
  pdf: foreign('a PDF document'),
  clip: {
    code: 'decode/unsupported',
    found: 'a clip of many frames',
    remedy: 'show it as the src of <gaussian-splat>, by an address whose path ends with .gsv',
  },
  fourDgs: {
    code: 'decode/unsupported',
    found: 'a .4dgs file, whose splats move',
    remedy: 'show it as the src of <gaussian-splat>, by an address whose path ends with .4dgs',
  },
  zstandard: foreign('a Zstandard file'),
};

const ONNX_MODEL: ForeignKind = {
  code: 'decode/unsupported',
  found: 'an ONNX model, which generates splats but is not a scene file',
  remedy: NOT_A_SCENE,
};

/** Viewer page that SuperSplat or splat-transform exports. The page may contain the scene itself. */
const VIEWER_PAGE: ForeignKind = {
  code: 'decode/html',
  found: 'the page of a viewer (SuperSplat), not the scene that it shows',
  remedy: 'give the address of the scene file, or export the scene again as .sog, .spz or .ply',
};

/** Number of bytes at the beginning of a web page that are searched for marks of a viewer. */
const PAGE_BYTES = 65_536;

const isViewerPage = (bytes: Uint8Array): boolean =>
  /<title>\s*SuperSplat|sse-viewer|supersplat-viewer/i.test(asciiOf(bytes, 0, PAGE_BYTES));

/** Returns the kind of a file without a signature: an ONNX model, a text, or other bytes. */
function unsignedKind(bytes: Uint8Array): ForeignKind {
  if (isOnnx(bytes)) return ONNX_MODEL;
  return /^[\t\n\r -~]+$/.test(sampleText(bytes))
    ? foreign('a text', true)
    : foreign(bytes.length > 0 ? `bytes that begin with ${hexOf(bytes)}` : 'no bytes');
}

/** Whether a protobuf begins as ONNX does: field 1 (IR version), then field 2 (producer) or 7 (graph). */
function isOnnx(bytes: Uint8Array): boolean {
  return bytes.length > 8 && bytes[0] === 8 && bytes[1] > 0 && bytes[1] < 32 && [0x12, 0x3a].includes(bytes[2]);
}

const A_SCENE = 'a Gaussian splat scene (PLY, compressed PLY, SPZ, SOG, .splat, .ksplat, glTF or OpenUSD)';

/**
 * Returns the error for a file that is not a supported scene. The error names the kind of file, which is identified by
 * signature, extension, or first bytes.
 * @param extension Extension of the file name in lower case, with its dot; may be empty.
 * @param expected Content that the caller expects, for the message.
 * @param remedy Advice for a file that is neither a scene nor a known substitute for one.
 */
export function diagnose(
  bytes: Uint8Array,
  name: string,
  extension: string,
  expected: string = A_SCENE,
  remedy = NOT_A_SCENE,
): GaussianSplatError {
  const signed = foreignName(bytes);
  // Some known kinds, such as tilesets, are JSON. None has another of the signatures.
  const known = !signed || signed === 'json' ? unreadKind(bytes, sampleText(bytes), extension) : undefined;
  if (known) return refusal(unread(known), name, undefined);
  if (signed === 'html' && isViewerPage(bytes)) return refusal(VIEWER_PAGE, name, bytes, expected);
  const kind = signed ? SIGNED_KINDS[signed] : unsignedKind(bytes);
  return refusal(kind.remedy === NOT_A_SCENE ? { ...kind, remedy } : kind, name, bytes, expected);
}

/**
 * Returns the error for a file that is not a mesh.
 * @param splats Name of its format, if it is a scene of splats.
 */
export function diagnoseMesh(bytes: Uint8Array, name: string, extension: string, splats?: string): GaussianSplatError {
  const expected = 'a mesh (glTF, GLB or PLY with faces)';
  if (!splats) return diagnose(bytes, name, extension, expected, 'give the address of a mesh: .glb, .gltf or .ply');
  return new GaussianSplatError('decode/unsupported', {
    ...{ where: name, expected, found: `Gaussian splats (${splats})` },
    remedy: 'show them by src of <gaussian-splat>, or of <splat-scene> beside other scenes',
  });
}

/** Returns the error for an archive of an unsupported kind, which one of its paths identifies; otherwise undefined. */
export function diagnoseArchive(paths: readonly string[], name: string): GaussianSplatError | undefined {
  const known = UNREAD_KINDS.find(({ within }) => within && paths.some((path) => within.test(path)));
  return known && refusal(unread(known), name, undefined);
}

/** Returns a phrase that describes the content of a file for error messages, for example `a PNG image`. */
export function describeContent(bytes: Uint8Array): string {
  if (sampleText(bytes).startsWith('ply')) return 'a PLY file';
  const signed = foreignName(bytes);
  const known = signed ? undefined : unreadKind(bytes, sampleText(bytes), '');
  if (known) return known.found;
  return (signed ? SIGNED_KINDS[signed] : unsignedKind(bytes)).found;
}

function refusal(
  kind: ForeignKind,
  name: string,
  bytes: Uint8Array | undefined,
  expected = A_SCENE,
): GaussianSplatError {
  const start = bytes && kind.isText ? `: ${quote(sampleText(bytes).trim(), 40)}` : '';
  return new GaussianSplatError(kind.code, {
    where: bytes ? `${name} (${grouped(bytes.length)} bytes), byte 0` : name,
    expected,
    found: kind.found + start,
    remedy: kind.remedy,
  });
}

function hexOf(bytes: Uint8Array): string {
  return Array.from(bytes.subarray(0, 8), (byte) => byte.toString(16).padStart(2, '0')).join(' ');
}
