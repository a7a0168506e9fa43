/** Small clips, written without measurement. */
import { deflateRawSync, constants } from 'node:zlib';
import type { GaussianCloud } from '@gaussian-splat/core';
import { codeClip, encodingsFor, type CodedClip } from '@gaussian-splat/economise';

const STEPS = { position: 0.002, rotation: 0.01, scale: 0.01, opacity: 0.004, color: 0.01 };

/** A clip whose groups have PLY files, so that nothing but motion is rounded. */
export function clipOf(
  frameOf: (frame: number) => GaussianCloud,
  {
    frames,
    framesPerSecond = 10,
    framesPerGroup,
  }: { frames: number; framesPerSecond?: number; framesPerGroup: number },
): Promise<CodedClip> {
  const [encoding] = encodingsFor('a.ply');
  return codeClip({
    ...{ frameCount: frames, framesPerSecond, framesPerGroup, minDecibels: 45 },
    openFrame: async (frame) => frameOf(frame),
    device: undefined as unknown as GPUDevice,
    encodeWebp: () => Promise.reject(new Error('not needed')),
    deflate: (bytes) => deflateRawSync(bytes, { finishFlush: constants.Z_SYNC_FLUSH }),
    rounding: { encoding, steps: STEPS },
  });
}
