import type { Viewer } from '../viewer/viewer.js';
import type { ViewerFrame } from '../viewer/camera/orbit.js';
import { isVoxelPath, type FloorOptions, type FloorMap } from '@gaussian-splat/formats/floor';
import { GaussianSplatError, type Vector3 } from '@gaussian-splat/core';
import type { SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import { kindOf } from '../sources/source-kinds.js';

/** Sources and settings from which {@link openFloor} makes a map of the floor. */
export interface FloorSource {
  readonly loader: SceneLoader;
  /** The request that loaded the scene. */
  readonly request: SceneRequest;
  /** Absolute URL of a `.floor` or `.voxel.json` file; null to compute the map from the splats. */
  readonly mapUrl: string | null;
  readonly frame: ViewerFrame;
  readonly metersPerUnit: number;
  /** Height of the eyes above the floor, meters. */
  readonly eyeHeight: number;
  /** Position of the camera's eye in viewer space, meters. */
  readonly near: Vector3;
}

/** Returns the absolute URL of the map that the page names; null if the floor is to be found in the splats. */
export function mapUrlOf({ attributes, element }: Viewer): string | null {
  const url = attributes.walkMap?.trim() || 'auto';
  return url === 'auto' ? null : new URL(url, element.baseURI).href;
}

/** Returns the address of a map as the page rewrites it. */
export const rewritten = ({ services }: Viewer, url: string | null): string | null =>
  url && (services.urlModifier?.(url) ?? url);

/** Sets the map of the next scene; null to find its floor in the splats. */
export function setMapUrl({ element }: Viewer, url: string | null): void {
  Object.assign(element, { walkMap: url });
}

/** Free height above the eyes, meters, that a body needs. */
const ABOVE_EYES = 0.1;

/**
 * Returns the map of a scene's floor: from its file, or computed from the splats in a worker. Rejects with
 * GaussianSplatError, or with the signal's reason after it is aborted.
 */
export async function openFloor(source: FloorSource, signal: AbortSignal): Promise<FloorMap> {
  const { loader, request, mapUrl, frame, metersPerUnit, eyeHeight, near } = source;
  const { url, file, credentials, limits } = request;
  const voxelUrl = mapUrl !== null && isVoxelPath(new URL(mapUrl).pathname) ? mapUrl : undefined;
  const isMap = mapUrl !== null && voxelUrl === undefined;
  const map = isMap ? await loader.fetchFile({ url: mapUrl, credentials, limits }, signal) : undefined;
  if (mapUrl === null && kindOf(request).name === 'stream')
    throw new GaussianSplatError('argument/value', {
      where: 'walk-map',
      expected: 'a file of the floor, because the scene is streamed',
      found: 'none',
      remedy: 'make one with gaussian-splat floor from the file that the folder was made from',
    });
  const options: FloorOptions = { metersPerUnit, frame, height: eyeHeight + ABOVE_EYES, near };
  const asked = { url, file, credentials, limits, options, voxelUrl, map };
  return loader.ask('floor', asked, signal);
}
