import { bytesSource } from './byte-source.js';
import type { OnnxHeader } from './header.js';
import { readOnnxHeader } from './read-onnx-header.js';
import { openUrl, type UrlSourceOptions } from './url-source.js';

/** A model with its header. */
export interface OpenedModel {
  readonly header: OnnxHeader;
  /** Length of the file in bytes. */
  readonly size: number;
  /** The whole file, if reading the header has loaded it. */
  readonly whole?: Uint8Array | undefined;
}

/** Location of a model: a server, or bytes in memory. */
export type ModelPlace =
  | ({ readonly url: string } & Pick<UrlSourceOptions, 'credentials'>)
  | { readonly bytes: Uint8Array; readonly name: string };

/**
 * Reads the header of a model.
 * @throws GaussianSplatError as {@link readOnnxHeader} and {@link openUrl} do; the reason of the signal.
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
