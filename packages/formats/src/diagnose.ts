import { GaussianSplatError, type ErrorCode } from '@gaussian-splat/core';
import { asciiOf, grouped, quote, startsWith } from './bytes.js';

/** A kind of file that is recognised only to say what it is. */
interface ForeignKind {
  readonly code: ErrorCode;
  readonly found: string;
  readonly remedy: string;
  /** True if the first words help to recognise the file. */
  readonly isText?: boolean;
  readonly fits: (bytes: Uint8Array, text: string) => boolean;
}

const CONVERT = 'convert it to SPZ or PLY, for example with splat-transform or SuperSplat';
const CHECK_URL = 'check the address of the scene; the server sent something else';
const NOT_A_SCENE = 'give the address of a scene file: .ply, .compressed.ply, .spz, .sog, .splat, .ksplat or .glb';

const unread = (found: string, fits: ForeignKind['fits']): ForeignKind => ({
  code: 'decode/unsupported',
  found: `${found}, a format that is known but not read yet`,
  remedy: CONVERT,
  fits,
});
const foreign = (found: string, fits: ForeignKind['fits'], isText = false): ForeignKind => ({
  code: 'decode/unknown-format',
  found,
  remedy: NOT_A_SCENE,
  isText,
  fits,
});
const isJson = (text: string): boolean => /^\s*(\{\s*("|\}|$)|\[\s*(["\d[{\]-]|$))/.test(text);

/** Kinds of files with a signature that no scene format shares; the first that fits wins. */
const SIGNED_KINDS: readonly ForeignKind[] = [
  {
    code: 'decode/lfs-pointer',
    found: 'a git-LFS pointer, which only names the real file',
    remedy: 'run "git lfs pull" where the file is served from, or use the address of the media file',
    fits: (_, text) => text.startsWith('version https://git-lfs.github.com/spec/'),
  },
  {
    code: 'decode/html',
    found: 'a web page (HTML)',
    remedy: `${CHECK_URL}, perhaps an error or login page`,
    isText: true,
    fits: (_, text) => /^\s*(<!--[^]*?-->\s*)*<(!doctype\s+html|html|head|body|script|title)\b/i.test(text),
  },
  {
    ...foreign('an XML document, as storage servers send for missing or private files', (_, text) =>
      /^\s*<(\?xml\b|[a-z]+[\s>])/i.test(text),
    ),
    remedy: CHECK_URL,
  },
  {
    code: 'decode/unsupported',
    found: 'the manifest of a sequence, which names many scenes',
    remedy: 'read it with parseSequence, and its frames one by one',
    fits: (_, text) => isJson(text) && /"gaussianSplatSequence"\s*:/.test(text),
  },
  foreign('a JSON text', (_, text) => isJson(text), true),
  foreign('a PNG image', (bytes) => startsWith(bytes, '\x89PNG')),
  foreign('a JPEG image', (bytes) => startsWith(bytes, '\xff\xd8\xff')),
  foreign('a WebP image', (bytes) => startsWith(bytes, 'RIFF') && startsWith(bytes, 'WEBP', 8)),
  foreign('a GIF image', (bytes) => startsWith(bytes, 'GIF8')),
  foreign('a PDF document', (bytes) => startsWith(bytes, '%PDF-')),
  foreign('a Zstandard file', (bytes) => startsWith(bytes, [0x28, 0xb5, 0x2f, 0xfd])),
];

/** Kinds whose signature is weak; they are asked only where neither content nor name speaks for a scene. */
const UNSIGNED_KINDS: readonly ForeignKind[] = [
  {
    code: 'decode/unsupported',
    found: 'an ONNX model, which generates splats but is not a scene file',
    remedy: NOT_A_SCENE,
    fits: (bytes) => isOnnx(bytes),
  },
  foreign('a text', (_, text) => /^[\t\n\r -~]+$/.test(text), true),
];

/** Formats told by the name where the content has no signature. */
const UNREAD_EXTENSIONS: ReadonlyMap<string, string> = new Map([
  ['.rad', 'a .rad scene'],
  ['.lcc', 'an LCC scene'],
]);

/** What an ONNX file begins with: field 1 (IR version) and then field 2 (producer) or 7 (graph) of its protobuf. */
function isOnnx(bytes: Uint8Array): boolean {
  return bytes.length > 8 && bytes[0] === 8 && bytes[1] > 0 && bytes[1] < 32 && [0x12, 0x3a].includes(bytes[2]);
}

const SAMPLE_BYTES = 1024;

function sampleText(bytes: Uint8Array): string {
  // A byte-order mark is three such characters.
  return asciiOf(bytes, 0, SAMPLE_BYTES).replace(/^\u00ef\u00bb\u00bf/, '');
}

/** True if a file has the signature of something else than a scene. */
export function isForeign(bytes: Uint8Array): boolean {
  const text = sampleText(bytes);
  return SIGNED_KINDS.some(({ fits }) => fits(bytes, text));
}

/** An error that says what a file is that has the signature of something else than a scene; else undefined. */
export function diagnoseSigned(bytes: Uint8Array, name: string): GaussianSplatError | undefined {
  const text = sampleText(bytes);
  const kind = SIGNED_KINDS.find(({ fits }) => fits(bytes, text));
  return kind && refusal(kind, name, bytes);
}

/** An error for a file that its name calls a format that is known but not read; else undefined. */
export function diagnoseExtension(name: string, extension: string): GaussianSplatError | undefined {
  const found = UNREAD_EXTENSIONS.get(extension);
  return found === undefined
    ? undefined
    : refusal(
        unread(found, () => true),
        name,
        undefined,
      );
}

/** The error for a file that no reader knows. */
export function diagnoseUnknown(bytes: Uint8Array, name: string): GaussianSplatError {
  const text = sampleText(bytes);
  const kind =
    UNSIGNED_KINDS.find(({ fits }) => fits(bytes, text)) ??
    foreign(`bytes that begin with ${hexOf(bytes)}`, () => true);
  return refusal(kind, name, bytes);
}

/** Names the content of a file for an error message. */
export function describeContent(bytes: Uint8Array): string {
  const text = sampleText(bytes);
  if (text.startsWith('ply')) return 'a PLY file';
  const kind = [...SIGNED_KINDS, ...UNSIGNED_KINDS].find(({ fits }) => fits(bytes, text));
  return kind?.found ?? `bytes that begin with ${hexOf(bytes)}`;
}

function refusal(kind: ForeignKind, name: string, bytes: Uint8Array | undefined): GaussianSplatError {
  const start = bytes && kind.isText ? `: ${quote(sampleText(bytes).trim(), 40)}` : '';
  return new GaussianSplatError(kind.code, {
    where: bytes ? `${name} (${grouped(bytes.length)} bytes), byte 0` : name,
    expected: 'a Gaussian splat scene (PLY, compressed PLY, SPZ, SOG, .splat, .ksplat or glTF)',
    found: kind.found + start,
    remedy: kind.remedy,
  });
}

function hexOf(bytes: Uint8Array): string {
  return Array.from(bytes.subarray(0, 8), (byte) => byte.toString(16).padStart(2, '0')).join(' ');
}
