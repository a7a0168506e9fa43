/** Reader of files of motion, whose format docs/sequences.md describes. */
import type { GaussianCloud } from '@gaussian-splat/core';
import type { LoadBudget } from '../budget.js';
import { checkedPart } from '../foreign-signatures.js';
import type { Motion } from '../motion.js';
import { CODED_MARK, readCodedMotion } from './coded-motion.js';
import { readDeflatedMotion } from './deflated-motion.js';

/** A motion file, and the splats and the count of frames to which it applies. */
export interface MotionFile {
  readonly bytes: Uint8Array;
  readonly name: string;
  /** The splats, in the order of their scene file. */
  readonly cloud: Pick<GaussianCloud, 'count' | 'positions'>;
  readonly frames: number;
  readonly budget: LoadBudget;
}

/**
 * Reads a motion file.
 * @throws GaussianSplatError `decode/corrupt`, `decode/truncated`, `decode/unsupported`, `decode/header`, `decode/html`, `decode/lfs-pointer`, or `out-of-memory/budget`
 */
export async function readMotion({ bytes, name, cloud, frames, budget }: MotionFile): Promise<Motion> {
  const own = await checkedPart(bytes, name);
  return own[0] === CODED_MARK
    ? readCodedMotion({ bytes: own, name, cloud, frames, budget })
    : readDeflatedMotion(own, name, { splats: cloud.count, frames, budget });
}
