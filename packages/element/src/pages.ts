/** Pages of streamed scenes, for renderers in a page's own context: `GlHost.stream` of `@gaussian-splat/renderer/webgl`. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { SceneLimits } from './loading/protocol.js';
import { SceneLoader } from './loading/scene-loader.js';
import { openPages as open, type OpenedPages } from './sources/stream/open-pages.js';

export type { OpenedPages } from './sources/stream/open-pages.js';
export type { SceneLimits } from './loading/protocol.js';

export interface PagesRequest {
  readonly signal?: AbortSignal;
  /** Mode of fetch for cookies. Default: `same-origin`. */
  readonly credentials?: RequestCredentials;
  readonly limits?: SceneLimits;
  /**
   * Whether workers pack 3D Tiles, LCC and RAD in float32, as WebGL draws them, so that no page is unpacked on the main
   * thread. Their pages take more memory. Default: false.
   */
  readonly isExact?: boolean;
  /** Called with warnings about content that is not drawn. */
  readonly onWarning?: (error: unknown) => void;
}

let loader: SceneLoader | undefined;

/**
 * Opens a streamed scene: `detail.json`, `lod-meta.json`, `tileset.json`, LCC or RAD. Workers fetch and pack its pages.
 * @throws GaussianSplatError `network/*` and `decode/*`; `decode/unsupported` for a file without levels; the reason of
 * `signal`.
 */
export async function openPages(src: string | URL, options: PagesRequest = {}): Promise<OpenedPages> {
  const { signal = new AbortController().signal, credentials = 'same-origin', limits, isExact, onWarning } = options;
  loader ??= new SceneLoader();
  const { href: url } = new URL(src, document.baseURI);
  const request = { url, credentials, limits, isExact, sh: 'auto' } as const;
  const opened = await open(request, { loader, signal, onProgress: () => undefined, onError: onWarning });
  if (opened) return opened;
  throw new GaussianSplatError('decode/unsupported', {
    where: url,
    expected: 'a scene with levels of detail',
    found: 'one without',
    remedy: 'read it whole, with fetchScene and readScene of @gaussian-splat/formats',
  });
}
