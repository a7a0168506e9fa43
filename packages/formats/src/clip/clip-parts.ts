/** Parts of clips: their splats, their motion, and the frames that they have together. */
import { keepUsable, toDegree, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { grouped } from '../bytes.js';
import type { ClipPart } from '../clip.js';
import { damaged } from '../faults.js';
import { mergeClouds } from '../merge-clouds.js';
import { applyMotion, ANIMATED_ATTRIBUTES, ANIMATED_ATTRIBUTE_NAMES, stillMotion, type Motion } from '../motion.js';
import { readScene } from '../read-scene.js';
import { readMotion } from './read-motion.js';

/** Bytes of a decoded splat without its codes: attributes, coefficients of degree 0 and fades. */
const SPLAT_BYTES = 60;

/** Returns the size in bytes of a decoded part for the GPU, without curves and coefficients above degree 0. */
export const clipPartBytes = ({ splats, planes }: Pick<ClipPart, 'splats' | 'planes'>): number =>
  splats * (SPLAT_BYTES + 2 * planes);

/** Decoded content of a part. */
export interface ClipPartContent {
  readonly cloud: GaussianCloud;
  readonly motion: Motion;
}

export interface ClipPartSource {
  /** Exactly the bytes of the part's scene and motion. */
  readonly bytes: Uint8Array;
  readonly part: ClipPart;
  readonly frames: number;
  /** Degree of the clip's index. A part with a lower one is padded with zeros. */
  readonly shDegree: ShDegree;
  readonly name: string;
  readonly limits?: LoadLimits;
}

/**
 * Reads the scene and the motion of a part.
 * @throws GaussianSplatError as `readScene` and `readMotion` do, and `decode/header` if the part contradicts the index.
 */
export async function readClipPart({
  bytes,
  part,
  frames,
  shDegree,
  name,
  limits,
}: ClipPartSource): Promise<ClipPartContent> {
  const { sceneBytes, motionBytes, splats, planes } = part;
  if (bytes.length !== sceneBytes + motionBytes)
    throw damaged(name, `${grouped(sceneBytes + motionBytes)} bytes`, grouped(bytes.length), 'decode/truncated');
  const budget = new LoadBudget(bytes.length, limits);
  budget.takeSplats(splats, shDegree, name);
  const cloud = await readScene(bytes.subarray(0, sceneBytes), { name, ...limits });
  if (cloud.count !== splats)
    throw damaged(name, `${grouped(splats)} splats, as the index says`, grouped(cloud.count), 'decode/header');
  if (cloud.shDegree > shDegree)
    throw damaged(name, `degree ${shDegree} at most, as the index says`, `degree ${cloud.shDegree}`, 'decode/header');
  if (motionBytes === 0) return { cloud: toDegree(shDegree, cloud), motion: stillMotion(splats) };
  const motion = await readMotion({ bytes: bytes.subarray(sceneBytes), name, cloud, frames, budget });
  const found = ANIMATED_ATTRIBUTE_NAMES.reduce(
    (sum, each) => sum + ANIMATED_ATTRIBUTES[each] * motion.parts[each].rank,
    0,
  );
  if (found !== planes) throw damaged(name, `${planes} planes, as the index says`, String(found), 'decode/header');
  return { cloud: toDegree(shDegree, cloud), motion };
}

/**
 * Returns the splats that exist at a frame, from all given parts of one group and of the splats that never change.
 * @param frame Index within the group; 0 is the group's first frame.
 * @throws GaussianSplatError `decode/empty`, `out-of-memory/budget`
 */
export function clipFrame(
  parts: readonly ClipPartContent[],
  frame: number,
  name: string,
  budget: LoadBudget,
): GaussianCloud {
  const moved = parts.map(({ cloud, motion }) => applyMotion(cloud, motion, frame, name, budget));
  return keepUsable(
    mergeClouds(
      moved.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
      { budget, name },
    ),
  );
}
