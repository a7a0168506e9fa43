import { foreignName } from './foreign-signatures.js';
import { sceneFormats } from './late-formats.js';
import type { SceneFormat, SceneFormatName } from './scene-format.js';
import { looksLikeSplats } from './splat/plausible.js';

/**
 * Detects the format of a scene file: first by its content; second by the extension of `name`, for formats without a
 * signature; third by the media type; and finally by whether its numbers resemble those of a `.splat` file.
 *
 * @param name File name or URL; a query and a fragment are ignored.
 * @param contentType Media type from the server; parameters after a semicolon are ignored.
 * @returns Name of the format, or undefined if `readScene` does not support the file.
 */
export function detectFormat(bytes: Uint8Array, name = '', contentType = ''): SceneFormatName | undefined {
  return findFormat(bytes, name, contentType)?.name;
}

/** The format's entry in the registry; see {@link detectFormat}. */
export function findFormat(bytes: Uint8Array, name: string, contentType: string): SceneFormat | undefined {
  const signed = sceneFormats.find(({ hasSignature }) => hasSignature?.(bytes));
  if (signed || bytes.length === 0) return signed;
  // A `.splat` may begin with any bytes, even with text.
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
 * Extension of a file name or URL in lower case, with its dot; empty if there is none. Handles files such as `scene
 * #3.splat`, and addresses that end in a name.
 */
export function extensionOf(name: string): string {
  return /\.[a-z0-9]+(?=[?#]|$)/i.exec(name)?.[0].toLowerCase() ?? '';
}
