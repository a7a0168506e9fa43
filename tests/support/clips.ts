/** Small clips, written without measurement, and their frames. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { codeClip, encodingsFor, type CodedClip } from '@gaussian-splat/optimize';
import {
  clipFrame,
  clipGroupAt,
  LoadBudget,
  parseClip,
  readClipPart,
  type ClipPart,
  type ClipPartContent,
} from '@gaussian-splat/formats';

const STEPS = { position: 0.002, rotation: 0.01, scale: 0.01, opacity: 0.004, color: 0.01 };

/** A clip whose groups have PLY files, so that nothing but motion is rounded, or the finest files of another name. */
export function clipOf(
  frameOf: (frame: number) => GaussianCloud,
  {
    frames,
    framesPerSecond = 10,
    framesPerGroup,
    name = 'a.ply',
  }: { frames: number; framesPerSecond?: number; framesPerGroup?: number; name?: string },
): Promise<CodedClip> {
  const encoding = encodingsFor(name).at(-1)!;
  return codeClip({
    ...{ frameCount: frames, framesPerSecond, framesPerGroup, minPsnr: 45 },
    openFrame: async (frame) => frameOf(frame),
    draw: () => Promise.reject(new Error('not needed')),
    encodeWebp: () => Promise.reject(new Error('not needed')),
    rounding: { encoding, steps: STEPS },
  });
}

/** Returns a function that decodes the splats of a frame of a clip, as the element shows them. Groups are decoded once. */
export function framesOf(bytes: Uint8Array): (frame: number) => Promise<GaussianCloud> {
  const index = parseClip(bytes, 'a.gsv');
  const read = (parts: readonly ClipPart[], frames: number): Promise<ClipPartContent[]> =>
    Promise.all(
      parts.map((part) => {
        const own = bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes);
        return readClipPart({ bytes: own, part, frames, shDegree: index.shDegree, name: 'a.gsv' });
      }),
    );
  let last: { group: number; contents: ClipPartContent[] } | undefined;
  return async (frame) => {
    const group = clipGroupAt(index, frame);
    const { first, frames, parts } = index.groups[group];
    if (last?.group !== group)
      last = { group, contents: [...(await read(index.still, 1)), ...(await read(parts, frames))] };
    const { contents } = last;
    return clipFrame(contents, frame - first, 'a.gsv', new LoadBudget(1 << 28));
  };
}
