import { foreignName } from './foreign-signatures.js';
import { sceneFormats } from './late-formats.js';
import type { SceneFormat, SceneFormatName } from './scene-format.js';
import { looksLikeSplats } from './splat/plausible.js';

/**
 * Tells the format of a scene file: by its content first; by the extension of `name` second, for formats without a
 * signature; by the media type third; and as a last resort by whether its numbers look like those of a `.splat` file.
 *
 * @param name file name or URL; a query and a fragment are ignored.
 * @param contentType media type as a server sends it; parameters after a semicolon are ignored.
 * @returns the name of the format, or undefined if the file is none that `readScene` reads.
 */
export function detectFormat(bytes: Uint8Array, name = '', contentType = ''): SceneFormatName | undefined {
  return findFormat(bytes, name, contentType)?.name;
}

/** The format's entry in the registry; see {@link detectFormat}. */
export function findFormat(bytes: Uint8Array, name: string, contentType: string): SceneFormat | undefined {
  const signed = sceneFormats.find(({ hasSignature }) => hasSignature?.(bytes));
  if (signed || bytes.length === 0) return signed;
  // The first bytes of a `.splat` may be any, those of a text too.
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

/** Extension of a file name or URL in lower case, with its dot; empty if there is none. Files may be called `scene #3.splat`, and addresses end in a name. */
export function extensionOf(name: string): string {
  return /\.[a-z0-9]+(?=[?#]|$)/i.exec(name)?.[0].toLowerCase() ?? '';
}
