/** Says what a file is that is no scene: loaded when one has been refused. */
import { GaussianSplatError, type ErrorCode } from '@gaussian-splat/core';
import { grouped, quote } from './bytes.js';
import { foreignName, sampleText, type ForeignName } from './foreign-signatures.js';

/** A kind of file that is recognised only to say what it is. */
interface ForeignKind {
  readonly code: ErrorCode;
  readonly found: string;
  readonly remedy: string;
  /** True if the first words help to recognise the file. */
  readonly isText?: boolean;
}

const CONVERT = 'convert it to SPZ or PLY, for example with splat-transform or SuperSplat';
const CHECK_URL = 'check the address of the scene; the server sent something else';
const NOT_A_SCENE = 'give the address of a scene file: .ply, .compressed.ply, .spz, .sog, .splat, .ksplat or .glb';

const unread = (found: string): ForeignKind => ({
  code: 'decode/unsupported',
  found: `${found}, a format that is known but not read yet`,
  remedy: CONVERT,
});
const foreign = (found: string, isText = false): ForeignKind => ({
  code: 'decode/unknown-format',
  found,
  remedy: NOT_A_SCENE,
  isText,
});

/** What has a signature that no scene format shares. */
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
    remedy: 'read it with parseSequence, and its frames one by one',
  },
  json: foreign('a JSON text', true),
  png: foreign('a PNG image'),
  jpeg: foreign('a JPEG image'),
  webp: foreign('a WebP image'),
  gif: foreign('a GIF image'),
  pdf: foreign('a PDF document'),
  zstandard: foreign('a Zstandard file'),
};

const ONNX_MODEL: ForeignKind = {
  code: 'decode/unsupported',
  found: 'an ONNX model, which generates splats but is not a scene file',
  remedy: NOT_A_SCENE,
};

/** Kinds whose signature is weak: asked for only where neither content nor name speaks for a scene. */
function unsignedKind(bytes: Uint8Array): ForeignKind {
  if (isOnnx(bytes)) return ONNX_MODEL;
  return /^[\t\n\r -~]+$/.test(sampleText(bytes))
    ? foreign('a text', true)
    : foreign(`bytes that begin with ${hexOf(bytes)}`);
}

/** Formats told by the name where the content has no signature. */
const UNREAD_EXTENSIONS: ReadonlyMap<string, string> = new Map([
  ['.rad', 'a .rad scene'],
  ['.lcc', 'an LCC scene'],
  ['.lcc2', 'an LCC2 scene'],
  ['.splatv', 'a .splatv scene, which moves'],
  ['.usd', 'a USD scene'],
  ['.usda', 'a USD scene'],
  ['.usdc', 'a USD scene'],
  ['.usdz', 'a USDZ scene'],
  ['.pt', 'a checkpoint of PyTorch'],
  ['.npz', 'arrays of NumPy'],
  ['.slpk', 'an I3S scene'],
]);

/** What an ONNX file begins with: field 1 (IR version) and then field 2 (producer) or 7 (graph) of its protobuf. */
function isOnnx(bytes: Uint8Array): boolean {
  return bytes.length > 8 && bytes[0] === 8 && bytes[1] > 0 && bytes[1] < 32 && [0x12, 0x3a].includes(bytes[2]);
}

const A_SCENE = 'a Gaussian splat scene (PLY, compressed PLY, SPZ, SOG, .splat, .ksplat or glTF)';

/** The error that says what a file is that no reader knows: by its signature, by its name, or else by its bytes. */
export function diagnose(
  bytes: Uint8Array,
  name: string,
  extension: string,
  expected: string = A_SCENE,
): GaussianSplatError {
  const signed = foreignName(bytes);
  const known = UNREAD_EXTENSIONS.get(extension);
  if (signed && !(signed === 'json' && known)) return refusal(SIGNED_KINDS[signed], name, bytes, expected);
  return known === undefined ? refusal(unsignedKind(bytes), name, bytes) : refusal(unread(known), name, undefined);
}

/** Names the content of a file for an error message. */
export function describeContent(bytes: Uint8Array): string {
  if (sampleText(bytes).startsWith('ply')) return 'a PLY file';
  const signed = foreignName(bytes);
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
