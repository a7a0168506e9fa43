import { GaussianSplatError } from '@gaussian-splat/core';
import { pageLayout, type DetailManifest, type PageFormat } from './manifest.js';
import { listPages, type PageList } from './page-list.js';
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
  /** Called once with each page that came, when there is a slot for it. */
  readonly prepare?: (page: number, words: Uint32Array<ArrayBuffer>) => void;
}

/** The pages of a folder that `npm run detail` wrote. */
export function folderSource(
  manifest: DetailManifest,
  fetchPage: (file: string, signal: AbortSignal) => Promise<ArrayBuffer>,
): PageSource {
  const list = listPages(manifest);
  const fetch = async (page: number, signal: AbortSignal): Promise<Uint32Array<ArrayBuffer>> => {
    const file = list.file(page);
    const bytes = await fetchPage(file, signal);
    signal.throwIfAborted();
    const expected = 4 * pageLayout(manifest, list.chunks[page]).total;
    if (bytes.byteLength === expected) return new Uint32Array(bytes);
    throw new GaussianSplatError('decode/truncated', {
      where: file,
      expected: `${expected} bytes`,
      found: `${bytes.byteLength} bytes`,
      remedy: 'upload the folder again, all files of it from one run of npm run detail',
    });
  };
  const prepare = (page: number, words: Uint32Array<ArrayBuffer>): void =>
    movePage(words, list.translate(page), manifest, list.chunks[page]);
  return { scene: manifest, list, fetch, prepare };
}
