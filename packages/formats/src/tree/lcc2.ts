/** LCC2 of XGRIDS, node by node. */
import { refuse } from '../budget.js';
import { grouped } from '../bytes.js';
import { allocateCloud } from '../cloud.js';
import { warn } from '../faults.js';
import { parseLcc2Meta, type Lcc2Node } from '../lcc/meta-2.js';
import { cut } from '../lod/sog-files.js';
import { optionalPart } from '../readers/optional-part.js';
import type { ReadNode, SceneTree, TreeFiles, TreeReader } from './types.js';

/** Bytes of a node in a message to the page, without its path. */
const NODE_BYTES = 220;

/** Returns undefined if a node has no box, because then nothing says which splats its children replace. */
function open(bytes: Uint8Array, files: TreeFiles): SceneTree | undefined {
  const { roots, environment } = parseLcc2Meta({ bytes, name: files.name, budget: files.budget });
  let [weight, isBounded] = [0, roots.length > 0];
  const visit = ({ file = '', volume, children }: Lcc2Node): void => {
    weight += NODE_BYTES + file.length;
    isBounded &&= volume !== undefined;
    children.forEach(visit);
  };
  roots.forEach(visit);
  // Nodes have 100 bytes or more in the file, but a message repeats long paths.
  const max = 1e6 + 4 * bytes.length;
  if (weight > max) refuse(files.name, `nodes of at most ${grouped(max)} bytes`, grouped(weight));
  if (!isBounded) return undefined;
  const around: Lcc2Node[] = environment === undefined ? [] : [{ file: environment, children: [] }];
  const tree = { container: 'lcc2', facts: environment, isDescended: true, isComplete: true } as const;
  return { ...tree, roots: [...roots, ...around], up: [0, 0, 1] };
}

async function read({ file, run }: Lcc2Node, environment: string | undefined, files: TreeFiles): Promise<ReadNode> {
  const own = { found: [], isAdded: false, error: Infinity };
  if (file === undefined) return own;
  const asked = files.openSog(file);
  const cloud = await (file === environment ? optionalPart(asked, files.signal) : asked);
  if (cloud instanceof Error) {
    const none = allocateCloud(0, 0, files);
    warn(none, `The surroundings (${file}) are left out: ${cloud.message}`);
    return { ...own, cloud: none };
  }
  // The file's account has paid for its splats.
  return { ...own, cloud: run ? cut(cloud, { ...run, name: `${files.name}, ${file}` }) : cloud };
}

export const reader: TreeReader = {
  open: (bytes, files) => Promise.resolve(open(bytes, files)),
  read: (node, environment, files) => read(node as Lcc2Node, environment as string | undefined, files),
};
