import { foreignName } from './foreign-signatures.js';
import { sceneFormats } from './late-formats.js';
import type { SceneFormat, SceneFormatName } from './scene-format.js';
import { looksLikeSplats } from './splat/plausible.js';

/**
 * Detects the format of a scene file. Signatures in the content come first. For formats without one, the extension of
 * `name` is tested, and then the media type. Finally the numbers are tested for those of a `.splat` file.
 *
 * @param bytes The whole file, or its beginning.
 * @param name File name or URL; a query and a fragment are ignored.
 * @param contentType Media type from the server; parameters after a semicolon are ignored.
 * @returns Name of the format, or undefined if `readScene` does not support the file.
 */
export function detectFormat(bytes: Uint8Array, name = '', contentType = ''): SceneFormatName | undefined {
  return findFormat(bytes, name, contentType)?.name;
}

/** Returns the entry of {@link sceneFormats} for the format that {@link detectFormat} detects, or undefined. */
export function findFormat(bytes: Uint8Array, name: string, contentType: string): SceneFormat | undefined {
  const signed = sceneFormats.find(({ hasSignature }) => hasSignature?.(bytes));
  if (signed || bytes.length === 0) return signed;
  // A `.splat` file has no header, so that its first splat may look like the signature of another file.
  const isSplat = extensionOf(name) === '.splat' && looksLikeSplats(bytes, 'all');
  if (!isSplat && foreignName(bytes)) return undefined;
  const unsigned = sceneFormats.filter(({ hasSignature, isSignatureWeak }) => !hasSignature || isSignatureWeak);
  const extension = extensionOf(name);
  const mimeType = contentType.split(';')[0].trim().toLowerCase();
  return (
    unsigned.find(({ extensions }) => extensions.includes(extension)) ??
    unsigned.find(({ mimeTypes }) => mimeTypes.includes(mimeType)) ??
    (bytes.length % 32 === 0 && looksLikeSplats(bytes, 'all') ? unsigned.find((f) => f.name === 'splat') : undefined)
  );
}

/**
 * Returns the extension of a file name or URL in lower case, with its dot; an empty string if there is none. A `#` in a
 * file name such as `scene #3.splat` does not hide its extension.
 */
export function extensionOf(name: string): string {
  return /\.[a-z0-9]+(?=[?#]|$)/i.exec(name)?.[0].toLowerCase() ?? '';
}
