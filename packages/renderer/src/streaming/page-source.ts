import { GaussianSplatError, loadModule, type Vector3 } from '@gaussian-splat/core';
import { SharedReads } from '@gaussian-splat/core/fetch';
import type * as decoder from './decode-page.js';
import { pageLayout, type DetailManifest, type PageFormat } from './manifest.js';
import type { CodedFile } from './page-coding.js';
import { listPages, type PageList } from './page-list.js';
import { chunkLayout, type SlotWords } from './slot-words.js';

/** What is known of a streamed scene before any page of it has come. */
export type StreamedScene = PageFormat &
  Pick<DetailManifest, 'splats' | 'antialiased' | 'filterVariance' | 'order' | 'origin' | 'bounds'>;

/** A streamed scene, and where its pages come from. */
export interface PageSource {
  readonly scene: StreamedScene;
  readonly list: PageList;
  /**
   * Brings a page: for each slot of it in turn where its words lie, all slots but the last full. Rejects for one that cannot be had, or has not as many
   * chunks as {@link list} says.
   */
  readonly fetch: (page: number, signal: AbortSignal) => Promise<readonly SlotWords[]>;
  /** True for a page that need not be fetched: it is placed before others that are needed as much. */
  readonly isCached?: (page: number) => boolean;
  /** World units by which a page stands elsewhere than its words say. Default: none. */
  readonly translate?: (page: number) => Vector3;
}

/** Bytes of files that are kept: what is below a page is often wished for as soon as the page is there, and lies in the same file. */
const KEPT_BYTES = 64e6;

/**
 * Brings a file of pages.
 * @param coded what {@link decodePage} needs to know of it; undefined where files are not coded
 */
export type FetchPage = (
  file: string,
  signal: AbortSignal,
  coded?: CodedFile,
) => Promise<ArrayBuffer | ArrayBufferView<ArrayBuffer>>;

/**
 * The pages of a folder that `gaussian-splat detail` wrote. A file of the wrong length is not kept: the next time it is asked for it is fetched again.
 * @param isDecoded whether `fetchPage` decodes files that are coded
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

/** The bytes of a file in a buffer of their own, whatever view of one they came in. */
function wholeFile(where: string, length: number, bytes: ArrayBuffer | ArrayBufferView<ArrayBuffer>): ArrayBuffer {
  if (bytes.byteLength === length) return ArrayBuffer.isView(bytes) ? bufferOf(bytes) : bytes;
  throw new GaussianSplatError('decode/truncated', {
    where,
    expected: `${length} bytes`,
    found: `${bytes.byteLength} bytes`,
    remedy: 'upload the folder again, all files of it from one run of gaussian-splat detail',
  });
}

/** Of splats without bounds none is ever drawn: such a page is an error, as a file of them is. */
function requireBounds(where: string, bounds: Float32Array): void {
  if (bounds.every((number) => Number.isFinite(number))) return;
  throw new GaussianSplatError('decode/corrupt', {
    where,
    expected: 'bounds of splats',
    found: 'numbers that are not finite',
    remedy: 'write the folder again with npm run detail, and upload all files of it',
  });
}

const bufferOf = ({ buffer, byteOffset, byteLength }: ArrayBufferView<ArrayBuffer>): ArrayBuffer =>
  buffer.slice(byteOffset, byteOffset + byteLength);
