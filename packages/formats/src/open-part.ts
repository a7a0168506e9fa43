import { partUrl } from '@gaussian-splat/core';
import { fetchScene, type FetchSceneOptions } from './fetch-scene.js';
import type { OpenPart } from './scene-format.js';

/**
 * A way to the other files of the scene at an address, for `ReadSceneOptions.openPart`: each is fetched from beside it with the
 * same options, and with the scene's query unless the scene gives it one of its own.
 *
 * @param url absolute address of the scene's own file.
 * @param optionsOf options for each part, by its path.
 */
export function openPartAt(url: string | URL, optionsOf: (path: string) => FetchSceneOptions): OpenPart {
  return (path, query) => fetchScene(partAddress(url, path, query), optionsOf(path));
}

/** Address of another file of the scene at an address. Every part of the path is encoded, so that it can be no address of another server. */
export function partAddress(url: string | URL, path: string, query = ''): URL {
  // Two slashes would begin the name of a server.
  const encoded = path
    .replace(/^\/+/, '/')
    .split('/')
    .map((part) => (part === '..' || part === '.' ? part : encodeURIComponent(part)));
  return partUrl(encoded.join('/') + query, url);
}
