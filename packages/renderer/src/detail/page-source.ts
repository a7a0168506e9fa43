import { GaussianSplatError, type Vector3 } from '@gaussian-splat/core';
import { pageLayout, type DetailManifest, type PageFormat } from './manifest.js';
import { PageFiles } from './page-files.js';
import { listPages, type PageList } from './page-list.js';
import type { SlotWords } from './slot-words.js';

/** What is known of a streamed scene before any page of it has come. */
export type StreamedScene = PageFormat &
  Pick<DetailManifest, 'splats' | 'antialiased' | 'filterVariance' | 'origin' | 'bounds'>;

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
  readonly isAtHand?: (page: number) => boolean;
  /** World units by which a page stands elsewhere than its words say. Default: none. */
  readonly translate?: (page: number) => Vector3;
}

/** Bytes of files that are kept: what is below a page is often wished for as soon as the page is there, and lies in the same file. */
const KEPT_BYTES = 64e6;

/** The pages of a folder that `npm run detail` wrote. A file of the wrong length is not kept: the next time it is asked for it is fetched again. */
export function folderSource(
  manifest: DetailManifest,
  fetchPage: (file: string, signal: AbortSignal) => Promise<ArrayBuffer | ArrayBufferView<ArrayBuffer>>,
): PageSource {
  const list = listPages(manifest);
  const lengthOf = (chunks: number): number => 4 * pageLayout(manifest, chunks).total;
  const lengths = new Map(
    manifest.trees.flatMap(({ pages }) => pages.map(({ file, chunks }) => [file, lengthOf(chunks)])),
  );
  const fetchWhole = async (file: string, signal: AbortSignal): Promise<ArrayBuffer> =>
    wholeFile(file, lengths.get(file)!, await fetchPage(file, signal));
  const files = new PageFiles(fetchWhole, KEPT_BYTES);
  const fetch = async (page: number, signal: AbortSignal): Promise<SlotWords[]> => {
    const { file, first, chunks } = list.place(page);
    const bytes = await files.get(file.file, signal);
    signal.throwIfAborted();
    return [{ words: new Uint32Array(bytes), of: file.chunks, first, chunks }];
  };
  const isAtHand = (page: number): boolean => files.has(list.place(page).file.file);
  return { scene: manifest, list, fetch, isAtHand, translate: list.translate };
}

/** The bytes of a file in a buffer of their own, whatever view of one they came in. */
function wholeFile(where: string, length: number, bytes: ArrayBuffer | ArrayBufferView<ArrayBuffer>): ArrayBuffer {
  if (bytes.byteLength === length) return ArrayBuffer.isView(bytes) ? bufferOf(bytes) : bytes;
  throw new GaussianSplatError('decode/truncated', {
    where,
    expected: `${length} bytes`,
    found: `${bytes.byteLength} bytes`,
    remedy: 'upload the folder again, all files of it from one run of npm run detail',
  });
}

const bufferOf = ({ buffer, byteOffset, byteLength }: ArrayBufferView<ArrayBuffer>): ArrayBuffer =>
  buffer.slice(byteOffset, byteOffset + byteLength);
