/** LCC of XGRIDS, level by level of each cell. */
import { allocateCloud } from '../cloud.js';
import { HARMONICS_BYTES, parseLccIndex, parseLccMeta, SPLAT_BYTES, type LccMeta, type LccRun } from '../lcc/meta.js';
import { readAround, readRuns } from '../readers/lcc.js';
import type { ReadNode, SceneNode, SceneTree, TreeFiles, TreeReader } from './types.js';

/** A level of a cell; its child is the next finer level. A node without a run has the splats around the scene. */
interface LccNode extends SceneNode {
  readonly run?: LccRun;
}

async function open(bytes: Uint8Array, files: TreeFiles): Promise<SceneTree> {
  const meta = parseLccMeta({ bytes, name: files.name, budget: files.budget });
  const cells = parseLccIndex(await files.openFile('index.bin'), meta.levels, `${files.name}, index.bin`);
  const roots = cells.flatMap((runs) =>
    // The finest level is first in the file, and has no child.
    runs.reduce<LccNode[]>((below, run) => (run.count > 0 ? [{ run, children: below }] : below), []),
  );
  const around: LccNode = { children: [] };
  const tree = { container: 'lcc', facts: meta, isDescended: false, isComplete: true } as const;
  return { ...tree, roots: [...roots, around], up: [0, 0, 1] };
}

async function read({ run }: LccNode, meta: LccMeta, files: TreeFiles): Promise<ReadNode> {
  const own = { found: [], isAdded: false, error: Infinity };
  const part = (path: string): Promise<Uint8Array> => files.openFile(path);
  if (!run) return { ...own, cloud: await readAround(meta, part, files, allocateCloud(0, 0, files)) };
  const openRun = (path: string, stride: number): Promise<Uint8Array> => {
    const first = (run.start / SPLAT_BYTES) * stride;
    return files.openRange(path, first, first + stride * run.count);
  };
  const [data, harmonics] = await Promise.all([
    openRun('data.bin', SPLAT_BYTES),
    meta.hasHarmonics ? openRun('shcoef.bin', HARMONICS_BYTES) : undefined,
  ]);
  return { ...own, cloud: readRuns([{ start: 0, count: run.count }], meta, data, harmonics, files) };
}

export const reader: TreeReader = {
  open,
  read: (node, facts, files) => read(node as LccNode, facts as LccMeta, files),
};
