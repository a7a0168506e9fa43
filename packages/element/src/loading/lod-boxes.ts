/** Reads streamed SOG scenes box by box. The worker loads this module for the first such scene. */
import type { Credits } from '@gaussian-splat/core';
import { innerViewOf } from '@gaussian-splat/core/views';
import {
  fetchScene,
  LoadBudget,
  readCoarsestLevel,
  readLodScene,
  sogAddress,
  SogFiles,
  type FetchSceneOptions,
  type LodScene,
} from '@gaussian-splat/formats';
import type { StreamedScene } from '@gaussian-splat/renderer';
import { layoutLevels, packLevelPage, type LevelPage, type LevelScene } from '@gaussian-splat/renderer/tools';
import { fileLimits, fileName, limitsFrom, named, throttled } from './load-scene.js';
import { ProgressSum } from './progress-sum.js';
import type { SceneLimits, SceneRequest, TaskListeners } from './protocol.js';

/** A streamed SOG scene with its coarsest levels. */
export interface LoadedBoxes {
  readonly levels: LevelScene;
  /** Paths of the SOG files, relative to the index. */
  readonly files: readonly string[];
  /**
   * [R, 3] levels of all boxes, coarsest first within a box: index of the file, index of the first splat, and number of
   * splats.
   */
  readonly runs: Float64Array;
  /** [B] index in `runs` of the first level of each box. */
  readonly firstRuns: Uint32Array;
  readonly credits: Credits | undefined;
}

/**
 * A request for a level of a box of a streamed SOG scene. It contains all data that the worker needs, because the
 * worker may have been restarted since the previous request.
 */
export interface BoxRequest {
  /** Absolute address of the index. */
  readonly url: string;
  /** Path of the SOG file, relative to the index. */
  readonly path: string;
  /** Index of the level's first splat in the file. */
  readonly first: number;
  readonly count: number;
  readonly page: LevelPage;
  readonly scene: StreamedScene;
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
}

/** Cache of decoded files for all streamed SOG scenes of the page. */
const files = new SogFiles();
/** Maximum number of {@link accounts}; the least recently used are removed. */
const MAX_ACCOUNTS = 64;
/** Budgets that the files of each scene are charged to, by the address of the scene's index. */
const accounts = new Map<string, LoadBudget>();

function accountOf(url: string): LoadBudget {
  const account = accounts.get(url) ?? new LoadBudget(0);
  accounts.delete(url);
  accounts.set(url, account);
  for (const [oldest] of accounts) if (accounts.size > MAX_ACCOUNTS) accounts.delete(oldest);
  return account;
}

/**
 * Reads the index of a streamed SOG scene and the coarsest level of each of its boxes. Throws GaussianSplatError
 * (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function openBoxes(
  request: SceneRequest,
  signal: AbortSignal,
  { onProgress }: Pick<TaskListeners, 'onProgress'>,
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
    const coarsest = await readCoarsestLevel(lod, files, fetch, name, signal, limits());
    const boxes = lod.boxes.map(({ min, max, runs }) => ({ min, max, counts: runs.map(({ count }) => count) }));
    const credits = lod.credits ?? coarsest.hints?.credits;
    const levels = layoutLevels(coarsest, boxes, { sh });
    const { bounds } = levels.scene;
    const scene = { ...levels.scene, bounds: { ...bounds, inside: innerViewOf(coarsest, bounds) } };
    return { levels: { ...levels, scene }, ...placesOf(lod), credits };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

/**
 * Returns the places of all levels as arrays of numbers, because a message would copy the text of a path for each
 * object that has it.
 */
function placesOf({ boxes, files }: LodScene): Pick<LoadedBoxes, 'files' | 'runs' | 'firstRuns'> {
  const all = boxes.flatMap(({ runs }) => runs);
  const firstRuns = new Uint32Array(boxes.length);
  for (let b = 1; b < boxes.length; b++) firstRuns[b] = firstRuns[b - 1] + boxes[b - 1].runs.length;
  return { files, runs: Float64Array.from(all.flatMap(({ file, first, count }) => [file, first, count])), firstRuns };
}

/** Returns the words of a level of a box: see `packLevelPage`. Throws as {@link openBoxes} does. */
export async function readBox(
  { url, path, first, count, page, scene, credentials, limits }: BoxRequest,
  signal: AbortSignal,
): Promise<ArrayBuffer> {
  const run = { ...sogAddress(path, fileName(url), url), first, count };
  try {
    const fetch = (part: string, aborted: AbortSignal): Promise<Uint8Array> =>
      fetchScene(part, { mode: 'cors', credentials, signal: aborted, ...fileLimits(limits ?? {}) });
    return packLevelPage(await files.read(run, fetch, signal, accountOf(url)), page, scene).buffer;
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, run.name);
  }
}
