/** Small clips, written without measurement. */
import { deflateRawSync, constants } from 'node:zlib';
import type { GaussianCloud } from '@gaussian-splat/core';
import { codeClip, encodingsFor, type CodedClip } from '@gaussian-splat/economise';

const STEPS = { position: 0.002, rotation: 0.01, scale: 0.01, opacity: 0.004, color: 0.01 };

/** A clip whose groups have PLY files, so that nothing but motion is rounded, or the finest files of another name. */
export function clipOf(
  frameOf: (frame: number) => GaussianCloud,
  {
    frames,
    framesPerSecond = 10,
    framesPerGroup,
    name = 'a.ply',
  }: { frames: number; framesPerSecond?: number; framesPerGroup: number; name?: string },
): Promise<CodedClip> {
  const encoding = encodingsFor(name).at(-1)!;
  return codeClip({
    ...{ frameCount: frames, framesPerSecond, framesPerGroup, minPsnr: 45 },
    openFrame: async (frame) => frameOf(frame),
    device: undefined as unknown as GPUDevice,
    encodeWebp: () => Promise.reject(new Error('not needed')),
    deflate: (bytes) => deflateRawSync(bytes, { finishFlush: constants.Z_SYNC_FLUSH }),
    rounding: { encoding, steps: STEPS },
  });
}
