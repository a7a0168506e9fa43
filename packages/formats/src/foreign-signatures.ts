import { asciiOf, startsWith } from './bytes.js';
import { loadDiagnosis } from './load-files.js';

/** Whether a file is of a kind, from its bytes or from its first KiB as text. */
type Fits = (bytes: Uint8Array, text: string) => boolean;

const isJson: Fits = (_, text) => /^\s*(\{\s*("|\}|$)|\[\s*(["\d[{\]-]|$))/.test(text);

/**
 * Signatures of other kinds of files, which no scene format has; the first match applies. Their error messages are in
 * diagnose.ts, which is loaded only after a failure.
 */
const SIGNATURES = {
  lfsPointer: (_, text) => text.startsWith('version https://git-lfs.github.com/spec/'),
  // A comment has no `-->` within, so that a text can be divided into comments in one way only.
  html: (_, text) => /^\s*(<!--((?!-->)[^])*-->\s*)*<(!doctype\s+html|html|head|body|script|title)\b/i.test(text),
  xml: (_, text) => /^\s*<(\?xml\b|[a-z]+[\s>])/i.test(text),
  sequence: (bytes, text) => isJson(bytes, text) && /"gaussianSplatSequence"\s*:/.test(text),
  json: isJson,
  png: (bytes) => startsWith(bytes, '\x89PNG'),
  jpeg: (bytes) => startsWith(bytes, '\xff\xd8\xff'),
  webp: (bytes) => startsWith(bytes, 'RIFF') && startsWith(bytes, 'WEBP', 8),
  gif: (bytes) => startsWith(bytes, 'GIF8'),
  pdf: (bytes) => startsWith(bytes, '%PDF-'),
  clip: (bytes) => startsWith(bytes, 'GSV\n'),
  fourDgs: (bytes) => startsWith(bytes, '\x894DGS'),
  zstandard: (bytes) => startsWith(bytes, [0x28, 0xb5, 0x2f, 0xfd]),
} as const satisfies Readonly<Record<string, Fits>>;

export type ForeignName = keyof typeof SIGNATURES;

/** Returns the kind of file whose signature the bytes have; undefined for scenes and unknown files. */
export function foreignName(bytes: Uint8Array): ForeignName | undefined {
  const text = sampleText(bytes);
  const names = Object.keys(SIGNATURES) as ForeignName[];
  return names.find((name) => (SIGNATURES[name] as Fits)(bytes, text));
}

const SAMPLE_BYTES = 1024;

/** Returns the first KiB of a file as text, one character for each byte, without a byte-order mark. */
export function sampleText(bytes: Uint8Array): string {
  // The 3 bytes of a UTF-8 byte-order mark are 3 characters in this encoding.
  return asciiOf(bytes, 0, SAMPLE_BYTES).replace(/^\u00ef\u00bb\u00bf/, '');
}

/**
 * Returns the bytes of a file that a scene refers to. Throws if a server sent a substitute for a missing file: a web
 * page, or the pointer of a file that git LFS did not download.
 * @param name Name of the file in error messages.
 * @throws GaussianSplatError `decode/html`, `decode/lfs-pointer`
 */
export async function checkedPart(bytes: Uint8Array, name: string): Promise<Uint8Array> {
  if (!/^(html|lfsPointer)$/.test(foreignName(bytes) ?? '')) return bytes;
  const { diagnose } = await loadDiagnosis();
  throw diagnose(bytes, name, '', 'the file that the scene names');
}
