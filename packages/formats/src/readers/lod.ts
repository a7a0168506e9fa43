import { type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { damaged } from '../damaged.js';
import { parseLodMeta, runsAtLevel, type LodRun } from '../lod/meta.js';
import { mergeClouds, type CloudPart } from '../merge-clouds.js';
import type { OpenPart, SceneSource } from '../scene-format.js';
import { parseSogMeta } from '../sog/meta.js';
import { readSogImages } from '../sog/read-sog.js';
import { noParts } from './sog.js';

/**
 * Reads a streamed SOG scene from its `lod-meta.json` as a whole at one level of detail (`source.level`, 0 the finest; levels
 * beyond the last give the coarsest), with its environment.
 */
export async function readLod(source: SceneSource): Promise<GaussianCloud> {
  const { name, level = 0 } = source;
  const meta = parseLodMeta(source.bytes, name);
  const open = source.openPart ?? noParts(name);
  const runs = runsAtLevel(meta, Math.min(level, meta.levels - 1));
  const files = [...new Set(runs.map(({ file }) => file))];
  const parts: CloudPart[] = [];
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
    parts.push({ cloud, first: 0, count: cloud.count });
  }
  return mergeClouds(parts, name);
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
function partsOf(cloud: GaussianCloud, runs: readonly LodRun[], path: string, name: string): CloudPart[] {
  let end = 0;
  return [...runs]
    .sort((a, b) => a.offset - b.offset)
    .map(({ offset, count }) => {
      if (offset < end || offset + count > cloud.count) {
        const found = `splats ${grouped(offset)} to ${grouped(offset + count)}`;
        throw damaged(`${name}, tree, ${path}`, `runs apart within ${grouped(cloud.count)} splats`, found);
      }
      end = offset + count;
      return { cloud, first: offset, count };
    });
}
