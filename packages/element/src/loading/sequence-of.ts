/**
 * Reads the manifests of sequences, and frames that are stored as differences from the first frame. The module is
 * loaded only for sequences.
 */
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { SharedReads } from '@gaussian-splat/core/fetch';
import {
  fetchScene,
  LoadBudget,
  applyMotion,
  fileOpenerFor,
  readMotion,
  readScene,
  type FetchSceneOptions,
  type Motion,
} from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../camera/settings.js';
import { fileLimits, fileName, limitsFrom, named, throttled } from './load-scene.js';
import { ProgressSum } from './progress-sum.js';
import type { FileRequest, LoadedScene, MovedFrameRequest, ProgressListener } from './protocol.js';

export { parseSequence } from '@gaussian-splat/formats';

/** The first frame of a sequence; `arrived` is the number of its downloaded bytes. */
interface First {
  readonly cloud: GaussianCloud;
  readonly bounds: SceneBounds;
  readonly arrived: number;
}

/** Caches of first frames, and of files with differences, for all sequences of the page. */
const firsts = new SharedReads<First>(({ cloud }) => 4 * cloud.count * (11 + cloud.sh.length / cloud.count));
const motions = new SharedReads<Motion & { arrived: number }>(({ splats, parts }) =>
  Object.values(parts).reduce((sum, { codes }) => sum + 2 * splats * codes.length, 0),
);

/**
 * Reads and packs a frame of a sequence. Files that several frames need are read once. Throws GaussianSplatError
 * (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function readMovedFrame(
  { first, motion, sh, limits }: MovedFrameRequest,
  signal: AbortSignal,
  onProgress?: ProgressListener,
): Promise<LoadedScene> {
  const name = fileName((motion ?? first).url);
  try {
    const left = limitsFrom({ limits });
    const begun = await firsts.read(first.url, (aborted) => readFirst(first, left, aborted, onProgress), signal);
    const { bounds } = begun;
    const pack = (cloud: GaussianCloud): LoadedScene => ({
      ...{ packed: packGaussians(cloud, { sh }), bounds },
      warnings: cloud.warnings,
    });
    if (motion === undefined) return pack(begun.cloud);
    const { url, frame, frames } = motion;
    const moved = await motions.read(
      url,
      async (aborted) => {
        const bytes = await fetchScene(url, { ...optionsOf(motion, aborted), ...fileLimits(left()) });
        const budget = new LoadBudget(bytes.length, left());
        const own = await readMotion({ bytes, name, splats: begun.cloud.count, frames, budget });
        return { ...own, arrived: bytes.length };
      },
      signal,
    );
    const budget = new LoadBudget(begun.arrived + moved.arrived, left());
    return pack(applyMotion(begun.cloud, moved, frame, name, budget));
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

const optionsOf = ({ credentials }: FileRequest, signal: AbortSignal): FetchSceneOptions => ({
  ...{ mode: 'cors', credentials, signal },
});

async function readFirst(
  request: FileRequest,
  left: ReturnType<typeof limitsFrom>,
  signal: AbortSignal,
  onProgress: ProgressListener = () => undefined,
): Promise<First> {
  const { url } = request;
  const progress = new ProgressSum(throttled(onProgress), true);
  let arrived = 0;
  const options = (): FetchSceneOptions => ({
    ...{ ...optionsOf(request, signal), onProgress: progress.add() },
    ...fileLimits(left()),
  });
  const openFile = fileOpenerFor(url, options);
  const bytes = await fetchScene(url, options());
  const cloud = await readScene(bytes, {
    ...{ name: fileName(url), signal },
    openFile: async (path, query) => {
      const part = await openFile(path, query);
      arrived += part.byteLength;
      return part;
    },
    ...left(),
  });
  return { cloud, bounds: { ...boundsOf(cloud), ...cloud.hints }, arrived: arrived + bytes.length };
}
