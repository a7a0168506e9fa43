import { asciiOf, startsWith } from './bytes.js';
import { loadDiagnosis } from './load-parts.js';

/** Recognizes a kind of file by its bytes, or by its first words. */
type Fits = (bytes: Uint8Array, text: string) => boolean;

const isJson: Fits = (_, text) => /^\s*(\{\s*("|\}|$)|\[\s*(["\d[{\]-]|$))/.test(text);

/**
 * Kinds of files with a signature that no scene format shares; the first match wins. Their messages are in diagnose.ts,
 * which only failures load.
 */
const SIGNATURES = {
  lfsPointer: (_, text) => text.startsWith('version https://git-lfs.github.com/spec/'),
  html: (_, text) => /^\s*(<!--[^]*?-->\s*)*<(!doctype\s+html|html|head|body|script|title)\b/i.test(text),
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

/** Returns the kind of a file with a signature other than that of a scene; undefined for all others. */
export function foreignName(bytes: Uint8Array): ForeignName | undefined {
  const text = sampleText(bytes);
  const names = Object.keys(SIGNATURES) as ForeignName[];
  return names.find((name) => (SIGNATURES[name] as Fits)(bytes, text));
}

const SAMPLE_BYTES = 1024;

/** The first words of a file. */
export function sampleText(bytes: Uint8Array): string {
  // A byte-order mark takes three such characters.
  return asciiOf(bytes, 0, SAMPLE_BYTES).replace(/^\u00ef\u00bb\u00bf/, '');
}

/**
 * Returns a file that a scene names, unless it is a server's substitute for a missing one: a web page, or the pointer
 * of a file that git LFS never downloaded.
 * @param name Name of the file in error messages.
 * @throws GaussianSplatError `decode/html`, `decode/lfs-pointer`
 */
export async function checkedPart(bytes: Uint8Array, name: string): Promise<Uint8Array> {
  if (!/^(html|lfsPointer)$/.test(foreignName(bytes) ?? '')) return bytes;
  const { diagnose } = await loadDiagnosis();
  throw diagnose(bytes, name, '', 'the file that the scene names');
}
