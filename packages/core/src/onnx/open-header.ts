import { bytesSource } from './byte-source.js';
import type { OnnxHeader } from './header.js';
import { readOnnxHeader } from './read-onnx-header.js';
import { openUrl, type UrlSourceOptions } from './url-source.js';

/** A model of which the header has been read. */
export interface OpenedModel {
  readonly header: OnnxHeader;
  /** Bytes of the file. */
  readonly size: number;
  /** All of them, where reading the header brought them along. */
  readonly whole?: Uint8Array | undefined;
}

/** Where a model is: on a server, or in bytes that have arrived. */
export type ModelPlace =
  | ({ readonly url: string } & Pick<UrlSourceOptions, 'credentials'>)
  | { readonly bytes: Uint8Array; readonly name: string };

/**
 * Reads the header of a model.
 * @throws GaussianSplatError as {@link readOnnxHeader} and {@link openUrl} do; the reason of the signal
 */
export async function openHeader(place: ModelPlace, signal?: AbortSignal): Promise<OpenedModel> {
  if ('bytes' in place) {
    const { bytes, name } = place;
    return { header: await readOnnxHeader(bytesSource(bytes, name)), size: bytes.length, whole: bytes };
  }
  const file = await openUrl(place.url, { credentials: place.credentials, signal });
  const header = await readOnnxHeader(file);
  const { size, chunk } = file;
  return { header, size, whole: file.whole ?? (size <= chunk ? await file.read(0, size) : undefined) };
}
