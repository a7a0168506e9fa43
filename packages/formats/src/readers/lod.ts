import type { GaussianCloud } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { addCredits } from '../credits.js';
import { checkedPart } from '../foreign-signatures.js';
import { damaged } from '../faults.js';
import { parseLodMeta, runsAtAllLevels, runsAtLevel, type LodMeta, type NodeRun } from '../lod/meta.js';
import { levelRunsOf, mergeClouds, type NodePart } from '../merge-clouds.js';
import { previewWanted, type OpenFile, type SceneSource } from '../scene-format.js';
import { readSogPart } from '../sog/read-sog.js';
import { noParts } from './sog.js';

/**
 * Reads a streamed SOG scene with its environment, from its `lod-meta.json`, at the level of detail `source.level`: 0 is
 * the finest, and levels beyond the last give the coarsest. `all` reads all levels. The preview is the coarsest level.
 */
export async function readLod(source: SceneSource): Promise<GaussianCloud> {
  const { name, level = 0, maxSplats = Infinity } = source;
  const meta = parseLodMeta(source);
  const open = source.openFile ?? noParts(name, 'scene.zip');
  const coarsest = runsAtLevel(meta, meta.levels - 1);
  const around = await readEnvironment(meta, open, source);
  const countOf = (some: readonly NodeRun[]): number => some.reduce((sum, { count }) => sum + count, 0);
  let own = Math.min(level === 'all' ? 0 : level, meta.levels - 1);
  while (own < meta.levels - 1 && countOf(runsAtLevel(meta, own)) > maxSplats) own++;
  const runs = level === 'all' ? runsAtAllLevels(meta) : runsAtLevel(meta, own);
  if (previewWanted(source, countOf(runs)) && countOf(coarsest) < countOf(runs) / 2) {
    const parts = [...(await readRuns(coarsest, meta, open, source)), ...around];
    if (parts.length > 0) await source.onPreview?.(mergeClouds(parts, source));
  }
  const parts = [...(await readRuns(runs, meta, open, source)), ...around];
  const merged = mergeClouds(parts, source);
  addCredits(merged, meta.credits);
  return level === 'all' ? { ...merged, levelRuns: levelRunsOf(parts) } : merged;
}

/** Reads ranges of splats. Each file is read once; the result is ordered by file. */
async function readRuns(
  runs: readonly NodeRun[],
  { files }: LodMeta,
  open: OpenFile,
  source: SceneSource,
): Promise<NodePart[]> {
  const parts: NodePart[] = [];
  const byFile = new Map<number, NodeRun[]>();
  for (const run of runs) {
    const others = byFile.get(run.file);
    if (others) others.push(run);
    else byFile.set(run.file, [run]);
  }
  for (const [file, own] of byFile) {
    source.signal?.throwIfAborted();
    const cloud = await readPart(files[file], open, source);
    for (const part of partsOf(cloud, own, files[file], source.name)) parts.push(part);
  }
  return parts;
}

/** Reads the environment of a scene as a separate node with one level, so that it is always drawn. Empty without one. */
async function readEnvironment(
  { environment, leaves }: LodMeta,
  open: OpenFile,
  source: SceneSource,
): Promise<NodePart[]> {
  if (environment === undefined) return [];
  const cloud = await readPart(environment, open, source);
  return [{ cloud, first: 0, count: cloud.count, node: leaves.length, level: 0 }];
}

/** Reads a SOG of the scene. The paths of its images are relative to the SOG's own path. */
async function readPart(path: string, open: OpenFile, source: SceneSource): Promise<GaussianCloud> {
  const folder = path.slice(0, path.lastIndexOf('/') + 1);
  const { budget, signal } = source;
  const name = `${source.name}, ${path}`;
  const bytes = await checkedPart(await open(path), name);
  return readSogPart({ bytes, name, budget, signal }, (part) => open(folder + part));
}

/**
 * Returns the parts of a file's cloud for ranges of splats, in the order of the file. Throws `decode/corrupt` if ranges
 * overlap or exceed the file, so that all ranges together have no more splats than the file.
 */
function partsOf(cloud: GaussianCloud, runs: readonly NodeRun[], path: string, name: string): NodePart[] {
  let end = 0;
  return [...runs]
    .sort((a, b) => a.offset - b.offset)
    .map(({ offset, count, node, level }) => {
      if (offset < end || offset + count > cloud.count) {
        const found = `splats ${grouped(offset)} to ${grouped(offset + count)}`;
        throw damaged(`${name}, tree, ${path}`, `runs apart within ${grouped(cloud.count)} splats`, found);
      }
      end = offset + count;
      return { cloud, first: offset, count, node, level };
    });
}
