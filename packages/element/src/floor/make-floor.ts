/** Finds the walkable floor of a scene file. The worker loads this module on demand. */
import { fetchScene, fileOpenerFor, readScene, type FetchSceneOptions } from '@gaussian-splat/formats';
import {
  decodeFloorMap,
  floorOf,
  makeFloorMap,
  readVoxels,
  voxelTreePath,
  type FloorMap,
  type FloorOptions,
} from '@gaussian-splat/formats/floor';
import { fileLimits, fileName, limitsFrom, named } from '../loading/load-scene.js';
import type { FileRequest } from '../loading/protocol.js';

/** A scene file whose floor is to be found, and the dimensions of the walker. */
export interface FloorRequest extends FileRequest {
  /** Absolute address of a `.voxel.json`, which replaces the splats as the source of the floor. */
  readonly voxelUrl?: string | undefined;
  /** Bytes of a `.floor` file, which is decoded instead. */
  readonly map?: ArrayBuffer | undefined;
  readonly options: FloorOptions;
}

/**
 * Reads a scene file again, usually from the browser's cache, and finds its floor. If the request has a `voxelUrl` or a
 * `map`, reads that instead. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's
 * reason if that is aborted.
 */
export async function makeFloor(request: FloorRequest, signal: AbortSignal): Promise<FloorMap> {
  const { credentials, options, voxelUrl, map } = request;
  const url = voxelUrl ?? request.url;
  const name = fileName(url);
  try {
    const limits = limitsFrom(request);
    if (map !== undefined) return decodeFloorMap(new Uint8Array(map), undefined, limits());
    const fetchOptions = (): FetchSceneOptions => ({ mode: 'cors', credentials, signal, ...fileLimits(limits()) });
    const bytes = await fetchScene(url, fetchOptions());
    if (voxelUrl !== undefined) {
      const address = new URL(url);
      address.pathname = voxelTreePath(address.pathname);
      const tree = await fetchScene(address.href, fetchOptions());
      const { frame, metersPerUnit = 1 } = options;
      const { grid, solid } = readVoxels({ head: bytes, tree, name, limits: limits() }, frame, metersPerUnit);
      return floorOf(grid, solid, { ...options, limits: limits() });
    }
    const openFile = /^(blob|data):/.test(url) ? undefined : fileOpenerFor(url, fetchOptions);
    const cloud = await readScene(bytes, { name, signal, openFile, ...limits() });
    return makeFloorMap(cloud, { ...options, limits: limits() });
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}
