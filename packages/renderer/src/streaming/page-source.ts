import { GaussianSplatError, loadModule, type Vector3 } from '@gaussian-splat/core';
import { SharedReads } from '@gaussian-splat/core/fetch';
import type * as decoder from './decode-page.js';
import { pageLayout, type DetailManifest, type PageFormat } from './manifest.js';
import type { CodedFile } from './page-coding.js';
import { listPages, type PageList } from './page-list.js';
import { chunkLayout, type SlotWords } from './slot-words.js';

/** Properties of a streamed scene that are known before any page is loaded. */
export type StreamedScene = PageFormat &
  Pick<DetailManifest, 'splats' | 'antialiased' | 'filterVariance' | 'order' | 'origin' | 'bounds'>;

/** A streamed scene, its list of pages, and the source of these pages. */
export interface PageSource {
  readonly scene: StreamedScene;
  readonly list: PageList;
  /**
   * Fetches a page, and resolves to the words of each of its slots; all slots except the last are full. Rejects if the
   * page is unavailable, or its number of chunks differs from {@link list}.
   */
  readonly fetch: (page: number, signal: AbortSignal) => Promise<readonly SlotWords[]>;
  /** Returns whether a page is available without a fetch. Such a page precedes other pages with the same need. */
  readonly isCached?: (page: number) => boolean;
  /** Returns the translation of a page in world units. Default: none. */
  readonly translate?: (page: number) => Vector3;
}

/**
 * Maximum bytes of cached files. The children of a page are often requested as soon as the page is resident, and are in
 * the same file.
 */
const KEPT_BYTES = 64e6;

/**
 * Fetches a file of pages, and resolves to its bytes.
 * @param file Name of the file, relative to the manifest.
 * @param coded Parameters of `decodePage`; undefined if files are not coded.
 */
export type FetchPage = (
  file: string,
  signal: AbortSignal,
  coded?: CodedFile,
) => Promise<ArrayBuffer | ArrayBufferView<ArrayBuffer>>;

/**
 * Returns the page source of a folder that the command `detail` wrote. A file of the wrong length is not cached: the
 * next request fetches it again.
 * @param isDecoded Whether `fetchPage` decodes coded files.
 */
export function folderSource(manifest: DetailManifest, fetchPage: FetchPage, isDecoded = false): PageSource {
  const list = listPages(manifest);
  const { coding, shDegree } = manifest;
  const files = new Map(manifest.trees.flatMap(({ pages }) => pages.map((page) => [page.file, page])));
  const layout = chunkLayout(manifest);
  const fetchWords = async (file: string, signal: AbortSignal): Promise<ArrayBuffer | ArrayBufferView<ArrayBuffer>> => {
    if (coding === undefined) return fetchPage(file, signal);
    const { chunks, upper } = files.get(file)!;
    const coded = { chunks, upper, shDegree, coding };
    const found = await fetchPage(file, signal, coded);
    if (isDecoded) return found;
    const bytes = ArrayBuffer.isView(found)
      ? new Uint8Array(found.buffer, found.byteOffset, found.byteLength)
      : new Uint8Array(found);
    return (await loadDecoder()).decodePage(file, bytes, coded);
  };
  const fetchWhole = async (file: string, signal: AbortSignal): Promise<ArrayBuffer> => {
    const { chunks } = files.get(file)!;
    const bytes = wholeFile(file, 4 * pageLayout(manifest, chunks).total, await fetchWords(file, signal));
    requireBounds(file, new Float32Array(bytes, 0, (layout.chunks * bytes.byteLength) / (4 * layout.total)));
    return bytes;
  };
  const kept = new SharedReads<ArrayBuffer>(({ byteLength }) => byteLength, KEPT_BYTES);
  const fetch = async (page: number, signal: AbortSignal): Promise<SlotWords[]> => {
    const { file, first, chunks } = list.place(page);
    const bytes = await kept.read(file.file, (ended) => fetchWhole(file.file, ended), signal);
    signal.throwIfAborted();
    return [{ words: new Uint32Array(bytes), of: file.chunks, first, chunks }];
  };
  const isCached = (page: number): boolean => kept.has(list.place(page).file.file);
  return { scene: manifest, list, fetch, isCached, translate: list.translate };
}

const loadDecoder = (): Promise<typeof decoder> =>
  loadModule('the code that decodes pages', () => import('./decode-page.js'));

/** Returns the bytes of a file in a buffer without other content. Throws `decode/truncated` for another length. */
function wholeFile(where: string, length: number, bytes: ArrayBuffer | ArrayBufferView<ArrayBuffer>): ArrayBuffer {
  if (bytes.byteLength === length) return ArrayBuffer.isView(bytes) ? bufferOf(bytes) : bytes;
  throw new GaussianSplatError('decode/truncated', {
    where,
    expected: `${length} bytes`,
    found: `${bytes.byteLength} bytes`,
    remedy: 'upload the folder again, all files of it from one run of gaussian-splat detail',
  });
}

/** Throws `decode/corrupt` for bounds that are not finite: splats with such bounds would never be drawn. */
function requireBounds(where: string, bounds: Float32Array): void {
  if (bounds.every((number) => Number.isFinite(number))) return;
  throw new GaussianSplatError('decode/corrupt', {
    where,
    expected: 'bounds of splats',
    found: 'numbers that are not finite',
    remedy: 'write the folder again with gaussian-splat detail, and upload all files of it',
  });
}

const bufferOf = ({ buffer, byteOffset, byteLength }: ArrayBufferView<ArrayBuffer>): ArrayBuffer =>
  buffer.slice(byteOffset, byteOffset + byteLength);
