import { fetchScene, type FetchSceneOptions } from './fetch-scene.js';
import type { OpenPart } from './scene-format.js';

/**
 * A way to the other files of the scene at an address, for `ReadSceneOptions.openPart`: each is fetched from beside it with the
 * same options.
 *
 * @param url absolute address of the scene's own file.
 * @param optionsOf options for each part, by its path.
 */
export function openPartAt(url: string | URL, optionsOf: (path: string) => FetchSceneOptions): OpenPart {
  return (path) => {
    // Every part is encoded, so that a path can be no address of another server.
    const encoded = path.split('/').map((part) => (part === '..' || part === '.' ? part : encodeURIComponent(part)));
    return fetchScene(new URL(encoded.join('/'), url), optionsOf(path));
  };
}
