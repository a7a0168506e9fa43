/** Reads scenes whose splats belong to groups. The worker loads this module for the attribute `groups`. */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { readScene, type ReadSceneOptions } from '@gaussian-splat/formats';
import { readGroups } from '@gaussian-splat/formats/groups';
import { packedOrder, recentered } from '@gaussian-splat/renderer/tools';
import type { LoadedScene, SceneGroups } from './protocol.js';

/** Maximum number of groups, whose indices have 16 bits. */
const MAX_GROUPS = 1 << 16;

/**
 * Reads a scene with its groups. A file without them is read without, and a warning says so. Throws as `readScene` does.
 * @param property Name of the property of a PLY; empty for the first known one.
 */
export async function loadGrouped(
  bytes: Uint8Array,
  property: string,
  options: ReadSceneOptions & { readonly name: string },
  pack: (cloud: GaussianCloud) => Promise<LoadedScene>,
): Promise<LoadedScene> {
  try {
    if (!isPly(bytes)) throw notRead(options.name, 'a PLY', 'another format');
    const { cloud, ids } = await readGroups(bytes, { ...options, property: property || undefined });
    const groups = groupsOf(cloud, ids, options.name);
    return { ...(await pack(cloud)), groups };
  } catch (error) {
    if (!(error instanceof GaussianSplatError) || error.code !== 'argument/value') throw error;
    const scene = await pack(await readScene(bytes, options));
    return { ...scene, warnings: [...(scene.warnings ?? []), error.message] };
  }
}

const isPly = (bytes: Uint8Array): boolean => String.fromCharCode(...bytes.subarray(0, 3)) === 'ply';

function groupsOf(cloud: GaussianCloud, numbers: Int32Array, name: string): SceneGroups {
  const ids = Int32Array.from(new Set(numbers)).sort();
  if (ids.length > MAX_GROUPS) throw notRead(name, `at most ${MAX_GROUPS} groups`, `${ids.length}`);
  const indices = new Map(Array.from(ids, (id, k) => [id, k]));
  const of = Uint16Array.from(packedOrder(recentered(cloud)), (i) => indices.get(numbers[i])!);
  const counts = new Uint32Array(ids.length);
  const boxes = new Float64Array(6 * ids.length).map((_, k) => (k % 6 < 3 ? Infinity : -Infinity));
  const { positions, origin } = cloud;
  for (let i = 0; i < cloud.count; i++) {
    const group = indices.get(numbers[i])!;
    counts[group]++;
    for (let axis = 0; axis < 3; axis++) {
      const [low, high] = [6 * group + axis, 6 * group + axis + 3];
      const x = positions[3 * i + axis] + origin[axis];
      boxes[low] = Math.min(boxes[low], x);
      boxes[high] = Math.max(boxes[high], x);
    }
  }
  return { ids, counts, boxes, of };
}

const notRead = (where: string, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `${where}: groups`,
    ...{ expected, found },
    remedy: 'write the object of each splat as a property of a PLY; the scene is shown without groups',
  });
