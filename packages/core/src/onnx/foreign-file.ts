import { GaussianSplatError, type ErrorCode } from '../errors.js';

/** A kind of file that is recognized only to describe it in an error message. */
interface ForeignKind {
  readonly code: ErrorCode;
  readonly found: string;
  readonly remedy: string;
  readonly fits: (text: string) => boolean;
}

const GIVE_ONNX = 'give an ONNX file, as torch.onnx.export writes it';
const CHECK_URL = 'check the address of the model; the server sent something else, perhaps an error or login page';

const other = (found: string, fits: ForeignKind['fits'], remedy = GIVE_ONNX): ForeignKind => ({
  code: 'decode/unknown-format',
  found,
  remedy,
  fits,
});

/** Known kinds; the first whose `fits` is true applies. The text given to `fits` has one character for each byte. */
const KINDS: readonly ForeignKind[] = [
  other('an empty file', (text) => text === '', 'export or download the model again'),
  {
    code: 'decode/lfs-pointer',
    found: 'a git-LFS pointer, which only names the real file',
    remedy: 'run "git lfs pull" where the file is served from, or use the address of the media file',
    fits: (text) => text.startsWith('version https://git-lfs.github.com/spec/'),
  },
  {
    code: 'decode/html',
    found: 'a web page (HTML)',
    remedy: CHECK_URL,
    fits: (text) =>
      /^[\s\u00ef\u00bb\u00bf]*(<!--((?!-->)[^])*-->\s*)*<(!doctype\s+html|html|head|body|script|title)\b/i.test(text),
  },
  other(
    'an XML document, as storage servers send for missing or private files',
    (text) => /^[\s\u00ef\u00bb\u00bf]*<(\?xml\b|[a-z]+[\s>])/i.test(text),
    CHECK_URL,
  ),
  {
    code: 'decode/unsupported',
    found: 'a model in the format ORT, which holds no names that a contract could be checked against',
    remedy: 'give the ONNX file that it was made from',
    fits: (text) => text.slice(4, 8) === 'ORTM',
  },
  other(
    'a PyTorch checkpoint or another ZIP archive',
    (text) => text.startsWith('PK'),
    'export it with torch.onnx.export',
  ),
  other('a TensorFlow Lite model', (text) => text.slice(4, 8) === 'TFL3'),
  other('a GGUF file', (text) => text.startsWith('GGUF')),
  other('a PLY file, a scene rather than a generator', (text) => /^ply\r?\n/.test(text)),
  other('a gzip file', (text) => text.startsWith('\x1f\x8b'), 'unpack it first'),
  other(
    'a JSON text',
    (text) => /^\s*(\{\s*"|\[\s*["\d[{])/.test(text),
    'give the ONNX file; a contract goes beside it',
  ),
  other('a safetensors file', (text) => /^[^]{8}\{\s*"/.test(text)),
  other('a text', (text) => /^[\t\n\r -~]{8,}$/.test(text)),
];

/** Number of bytes at the beginning of a file that the signatures need. */
export const SIGNATURE_BYTES = 512;

/**
 * Returns the error for a file whose signature is that of another kind of file; undefined if it may be an ONNX model.
 */
export function diagnoseForeignFile(head: Uint8Array, name: string, size: number): GaussianSplatError | undefined {
  const text = new TextDecoder('latin1').decode(head.subarray(0, SIGNATURE_BYTES));
  const kind = KINDS.find(({ fits }) => fits(text));
  return (
    kind &&
    new GaussianSplatError(kind.code, {
      where: `${name} (${size} bytes), byte 0`,
      expected: 'an ONNX model',
      found: kind.found,
      remedy: kind.remedy,
    })
  );
}
