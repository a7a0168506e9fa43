import type { GaussianCloud } from '@gaussian-splat/core';
import { readScene, stillMotion, type ClipPartContent } from '@gaussian-splat/formats';
import { splatsOf } from '../reduce.js';
import type { Encoding } from '../write/index.js';
import { writePartScene } from './part-scene.js';
import type { WrittenClipPart } from './clip-part.js';

/** A part of the splats that never change, and its content as a reader decodes it. */
export interface StillPart {
  readonly written: WrittenClipPart;
  readonly content: ClipPartContent;
}

/** Encodes splats that never change. @param chosen Indices of the splats of the part. */
export async function writeStillPart(
  cloud: GaussianCloud,
  chosen: Uint32Array,
  encoding: Encoding,
): Promise<StillPart> {
  const own = splatsOf(cloud, chosen);
  const bytes = await writePartScene(own, encoding);
  return readStillPart({ splats: own.count, planes: 0, sceneBytes: bytes.length, motionBytes: 0, bytes });
}

export async function readStillPart(written: WrittenClipPart): Promise<StillPart> {
  const cloud = await readScene(written.bytes, { name: 'splats that never change' });
  return { written, content: { cloud, motion: stillMotion(cloud.count) } };
}
