import { keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { levelRunsOf, mergeClouds, type NodePart } from '../merge-clouds.js';
import { noSplats } from '../scene-errors.js';
import type { LodScene, SogAddress, SogRun } from './boxes.js';
import { cut, type FetchBytes, type SogFiles } from './sog-files.js';

/**
 * Reads the coarsest splats of each box of a streamed scene, and its environment. Each node of `levelRuns` is the index
 * of a box; the environment has the index after the last box. Unusable splats are dropped, so that a box may become
 * empty. `limits` apply to all files together.
 * @param fetch Fetches files that `files` has not cached.
 * @param name Name of the scene in error messages.
 * @throws GaussianSplatError as {@link SogFiles.read} does; `decode/empty` if no splat of the scene is usable.
 */
export async function readCoarsestLevel(
  { boxes, environment }: LodScene,
  files: SogFiles,
  fetch: FetchBytes,
  name: string,
  signal?: AbortSignal,
  limits?: LoadLimits,
): Promise<GaussianCloud> {
  const budget = new LoadBudget(0, limits);
  const parts: NodePart[] = new Array(boxes.length);
  const byFile = new Map<string, [node: number, run: SogRun][]>();
  boxes.forEach(({ runs: [run] }, node) => {
    const others = byFile.get(run.url);
    if (others) others.push([node, run]);
    else byFile.set(run.url, [[node, run]]);
  });
  // If reading one file fails, the downloads of the other files are aborted.
  const failed = new AbortController();
  const either = AbortSignal.any([failed.signal, ...(signal ? [signal] : [])]);
  const openFile = (file: SogAddress): Promise<GaussianCloud> => files.open(file, fetch, either, budget);
  const readFile = async (runs: readonly [number, SogRun][]): Promise<void> => {
    const cloud = await openFile(runs[0][1]);
    for (const [node, run] of runs) {
      parts[node] = { cloud: cut(cloud, run, budget), first: 0, count: run.count, node, level: 0 };
    }
  };
  const readAround = async (): Promise<void> => {
    if (environment === undefined) return;
    const cloud = await openFile(environment);
    parts[boxes.length] = { cloud, first: 0, count: cloud.count, node: boxes.length, level: 0 };
  };
  try {
    await Promise.all([...[...byFile.values()].map(readFile), readAround()]);
  } catch (error) {
    failed.abort(error);
    throw error;
  }
  const cloud = keepUsable({ ...mergeClouds(parts, { budget, name }), levelRuns: levelRunsOf(parts) });
  if (cloud.count === 0) throw noSplats(name, cloud);
  return cloud;
}
