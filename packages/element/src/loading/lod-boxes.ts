/** Loaded by the worker when the first streamed SOG scene is asked for. */
import { fetchScene, readCoarsest, readLodScene, SogFiles, type FetchSceneOptions } from '@gaussian-splat/formats';
import { layOutLevels, packLevelPage } from '@gaussian-splat/renderer';
import { fileLimits, fileName, limitsFrom, named, throttled } from './load-scene.js';
import { ProgressSum } from './progress-sum.js';
import type { BoxRequest, LoadedBoxes, ProgressListener, SceneRequest } from './protocol.js';

/** Of all such scenes of the page. */
const files = new SogFiles();

/**
 * Reads the index of a streamed SOG scene and the coarsest level of each of its boxes. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/allocation`), or
 * the signal's reason once that is aborted.
 */
export async function openBoxes(
  request: SceneRequest,
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<LoadedBoxes> {
  const { url, credentials, sh } = request;
  const name = fileName(url);
  const limits = limitsFrom(request);
  try {
    const progress = new ProgressSum(throttled(onProgress), true);
    const fetch = (part: string, aborted: AbortSignal): Promise<Uint8Array> => {
      const options: FetchSceneOptions = {
        ...{ mode: 'cors', credentials, signal: aborted, onProgress: progress.add() },
        ...fileLimits(limits()),
      };
      return fetchScene(part, options);
    };
    const lod = readLodScene(await fetch(url, signal), name, url, limits());
    const coarsest = await readCoarsest(lod, files, fetch, name, signal, limits());
    const boxes = lod.boxes.map(({ min, max, runs }) => ({ min, max, counts: runs.map(({ count }) => count) }));
    return { levels: layOutLevels(coarsest, boxes, { sh }), runs: lod.boxes.map(({ runs }) => runs) };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

/** The words of a level of a box: see `packLevelPage`. Throws as {@link openBoxes} does. */
export async function readBox(
  { run, page, scene, credentials, limits }: BoxRequest,
  signal: AbortSignal,
): Promise<ArrayBuffer> {
  try {
    const fetch = (part: string, aborted: AbortSignal): Promise<Uint8Array> =>
      fetchScene(part, { mode: 'cors', credentials, signal: aborted, ...fileLimits(limits ?? {}) });
    return packLevelPage(await files.read(run, fetch, signal), page, scene).buffer;
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, run.name);
  }
}
