import type { GaussianCloud } from '@gaussian-splat/core';
import { checkedPart } from '../foreign-signatures.js';
import { damaged, warn } from '../faults.js';
import { parseLcc2Meta, type Lcc2Node } from '../lcc/meta-2.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import { optionalPart } from './optional-part.js';
import { readSogPart } from '../sog/read-sog.js';
import { noParts } from './sog.js';

/**
 * Reads LCC2 of XGRIDS: a description (`.lcc2`) of a tree, whose nodes have SOG bundles. The level of detail is
 * `source.level`; 0 is the finest. The splats of the environment are added at every level, if their file exists. The z
 * axis points up, which becomes `hints.up`.
 */
export async function readLcc2(source: SceneSource): Promise<GaussianCloud> {
  const { name, level = 0, maxSplats = Infinity, budget, signal } = source;
  const { roots, levels: depths, counts, environment } = parseLcc2Meta(source);
  const levels = filesOf(roots, depths);
  if (levels[0].size === 0) throw damaged(`${name}, root.child`, 'files of the finest level', 'none', 'decode/header');
  const found = levels.filter(({ size }) => size > 0);
  let own = Math.min(level === 'all' ? 0 : level, found.length - 1);
  while (own < found.length - 1 && Number(counts[own]) > maxSplats) own++;
  const open = source.openFile ?? noParts(name, 'scene.zip');
  const clouds: GaussianCloud[] = [];
  let leftOut: string | undefined;
  for (const path of [...found[own], ...(environment === undefined ? [] : [environment])]) {
    signal?.throwIfAborted();
    const where = `${name}, ${path}`;
    const asked = open(path).then((part) => checkedPart(part, where));
    const bytes = await (path === environment ? optionalPart(asked, signal) : asked);
    if (bytes instanceof Error) {
      leftOut = `The surroundings (${path}) are left out: ${bytes.message}`;
      continue;
    }
    const folder = path.slice(0, path.lastIndexOf('/') + 1);
    clouds.push(await readSogPart({ bytes, name: where, budget, signal }, (part) => open(folder + part)));
  }
  const whole = mergeClouds(
    clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
    source,
  );
  if (leftOut !== undefined) warn(whole, leftOut);
  whole.hints = { ...whole.hints, up: [0, 0, 1] };
  return whole;
}

/** Returns the files of each level, the finest first. Nodes of a level share files, which no other level has. */
function filesOf(roots: readonly Lcc2Node[], depths: number): readonly Set<string>[] {
  const levels = Array.from({ length: depths }, () => new Set<string>());
  const visit = ({ file, children }: Lcc2Node, level: number): void => {
    if (file !== undefined) levels[level].add(file);
    for (const child of children) visit(child, level - 1);
  };
  for (const root of roots) visit(root, depths - 1);
  return levels;
}
