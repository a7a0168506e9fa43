/** Loaded only for the manifest of a sequence. */
import { parseSequence } from '@gaussian-splat/formats';
import type { LoadedSequence } from './protocol.js';

/**
 * The frames of a manifest, which are where it says, seen from its own address.
 * @throws GaussianSplatError `decode/*`
 */
export function sequenceOf(bytes: Uint8Array, name: string, url: string): LoadedSequence {
  const { frames, framesPerSecond, durationSeconds } = parseSequence(bytes, name);
  return { frames: frames.map((path) => new URL(path, url).href), framesPerSecond, durationSeconds };
}
