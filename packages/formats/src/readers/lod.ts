import type { GaussianCloud } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { damaged } from '../damaged.js';
import { parseLodMeta, runsAtAllLevels, runsAtLevel, type NodeRun } from '../lod/meta.js';
import { levelRunsOf, type NodePart } from '../lod/node-parts.js';
import { mergeClouds } from '../merge-clouds.js';
import type { OpenPart, SceneSource } from '../scene-format.js';
import { parseSogMeta } from '../sog/meta.js';
import { readSogImages } from '../sog/read-sog.js';
import { noParts } from './sog.js';

/**
 * Reads a streamed SOG scene from its `lod-meta.json` as a whole at one level of detail (`source.level`, 0 the finest; levels
 * beyond the last give the coarsest) or at all of them (`all`), with its environment.
 */
export async function readLod(source: SceneSource): Promise<GaussianCloud> {
  const { name, level = 0 } = source;
  const meta = parseLodMeta(source.bytes, name);
  const open = source.openPart ?? noParts(name);
  const runs = level === 'all' ? runsAtAllLevels(meta) : runsAtLevel(meta, Math.min(level, meta.levels - 1));
  const files = [...new Set(runs.map(({ file }) => file))];
  const parts: NodePart[] = [];
  for (const file of files) {
    source.signal?.throwIfAborted();
    const cloud = await readPart(meta.files[file], open, source);
    parts.push(
      ...partsOf(
        cloud,
        runs.filter((run) => run.file === file),
        meta.files[file],
        name,
      ),
    );
  }
  if (meta.environment !== undefined) {
    const cloud = await readPart(meta.environment, open, source);
    // Another node than all others, at a level of its own: it is always drawn.
    parts.push({ cloud, first: 0, count: cloud.count, node: meta.leaves.length, level: 0 });
  }
  const merged = mergeClouds(parts, name);
  return level === 'all' ? { ...merged, levelRuns: levelRunsOf(parts) } : merged;
}

/** One SOG of the scene; the paths in its description are relative to it. */
async function readPart(path: string, open: OpenPart, { name, signal }: SceneSource): Promise<GaussianCloud> {
  const folder = path.slice(0, path.lastIndexOf('/') + 1);
  const own = `${name}, ${path}`;
  const bytes = await open(path);
  const source: SceneSource = { bytes, name: own, signal };
  return readSogImages(parseSogMeta(bytes, own), (part) => open(folder + part), source);
}

/** The runs must lie within the file and apart from one another: together they never hold more splats than the file. */
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
