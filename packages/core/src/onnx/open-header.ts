import { bytesSource } from './byte-source.js';
import type { OnnxHeader } from './header.js';
import { readOnnxHeader } from './read-onnx-header.js';
import { openUrl, type UrlSourceOptions } from './url-source.js';

/** A model whose header has been read. */
export interface OpenedModel {
  readonly header: OnnxHeader;
  /** Length of the file in bytes. */
  readonly size: number;
  /** Bytes of the whole file if they were loaded to read the header; undefined otherwise. */
  readonly whole?: Uint8Array | undefined;
}

/** Location of a model: an address with its policy for cookies and its maximum size, or bytes in memory. */
export type ModelPlace =
  | ({ readonly url: string } & Pick<UrlSourceOptions, 'credentials' | 'maxBytes'>)
  | { readonly bytes: Uint8Array; readonly name: string };

/**
 * Reads the header of a model, and resolves to it.
 * @throws GaussianSplatError as {@link readOnnxHeader} and {@link openUrl} do; the reason of the signal.
 */
export async function openHeader(place: ModelPlace, signal?: AbortSignal): Promise<OpenedModel> {
  if ('bytes' in place) {
    const { bytes, name } = place;
    return { header: await readOnnxHeader(bytesSource(bytes, name)), size: bytes.length, whole: bytes };
  }
  const { url, credentials, maxBytes } = place;
  const file = await openUrl(url, { credentials, maxBytes, signal });
  const header = await readOnnxHeader(file);
  const { size, chunk } = file;
  return { header, size, whole: file.whole ?? (size <= chunk ? await file.read(0, size) : undefined) };
}
