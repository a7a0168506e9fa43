import { GaussianSplatError } from '@gaussian-splat/core';
import { pageLayout, type DetailManifest, type PageFormat } from './manifest.js';
import { PageFiles } from './page-files.js';
import { listPages, type PageList, type PagePlace } from './page-list.js';
import { movePage } from './page-pool.js';

/** What is known of a streamed scene before any page of it has come. */
export type StreamedScene = PageFormat & Pick<DetailManifest, 'splats' | 'antialiased' | 'origin' | 'bounds'>;

/** A streamed scene, and where its pages come from. */
export interface PageSource {
  readonly scene: StreamedScene;
  readonly list: PageList;
  /**
   * Brings a page: for each slot of it in turn what docs/detail-pages.md describes, all slots but the last full. Rejects for one that cannot be had, or has not as many
   * chunks as {@link list} says.
   */
  readonly fetch: (page: number, signal: AbortSignal) => Promise<Uint32Array<ArrayBuffer>>;
  /** True for a page that need not be fetched: it is placed before others that are needed as much. */
  readonly isAtHand?: (page: number) => boolean;
  /** Called once with each page that came, when there is a slot for it. */
  readonly prepare?: (page: number, words: Uint32Array<ArrayBuffer>) => void;
}

/** Bytes of files that are kept: what is below a page is often wished for as soon as the page is there, and lies in the same file. */
const KEPT_BYTES = 64e6;

/** The pages of a folder that `npm run detail` wrote. */
export function folderSource(
  manifest: DetailManifest,
  fetchPage: (file: string, signal: AbortSignal) => Promise<ArrayBuffer>,
): PageSource {
  const list = listPages(manifest);
  const files = new PageFiles(fetchPage, KEPT_BYTES);
  const fetch = async (page: number, signal: AbortSignal): Promise<Uint32Array<ArrayBuffer>> => {
    const place = list.place(page);
    const { file, chunks } = place.file;
    const bytes = await files.get(file, signal);
    signal.throwIfAborted();
    const expected = 4 * pageLayout(manifest, chunks).total;
    if (bytes.byteLength === expected) return cutOut(new Uint32Array(bytes), place, manifest);
    throw new GaussianSplatError('decode/truncated', {
      where: file,
      expected: `${expected} bytes`,
      found: `${bytes.byteLength} bytes`,
      remedy: 'upload the folder again, all files of it from one run of npm run detail',
    });
  };
  const prepare = (page: number, words: Uint32Array<ArrayBuffer>): void =>
    movePage(words, list.translate(page), manifest, list.chunks[page]);
  const isAtHand = (page: number): boolean => files.has(list.place(page).file.file);
  return { scene: manifest, list, fetch, isAtHand, prepare };
}

/** A copy of the words of one page of a file, laid out as a file of that page alone would be. */
function cutOut(words: Uint32Array, { file, first, chunks }: PagePlace, format: PageFormat): Uint32Array<ArrayBuffer> {
  const [all, own] = [pageLayout(format, file.chunks), pageLayout(format, chunks)];
  const page = new Uint32Array(own.total);
  let [from, to] = [0, 0];
  for (const part of ['chunks', 'details', 'geometry', 'sh'] as const) {
    const size = own[part] / chunks;
    page.set(words.subarray(from + size * first, from + size * (first + chunks)), to);
    from += all[part];
    to += own[part];
  }
  return page;
}
