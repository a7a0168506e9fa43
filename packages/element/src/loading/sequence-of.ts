/** Loaded only for the manifest of a sequence. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { parseSequence } from '@gaussian-splat/formats';
import type { LoadedSequence } from './protocol.js';

/**
 * The frames of a manifest, which are where it says, seen from its own address.
 * @throws GaussianSplatError `decode/*`; `decode/unsupported` for relative paths in a manifest that has no place (`blob:`, `data:`)
 */
export function sequenceOf(bytes: Uint8Array, name: string, url: string): LoadedSequence {
  const { frames, framesPerSecond, durationSeconds } = parseSequence(bytes, name);
  return { frames: frames.map((path) => addressOf(path, name, url)), framesPerSecond, durationSeconds };
}

function addressOf(path: string, name: string, url: string): string {
  if (URL.canParse(path, url)) return new URL(path, url).href;
  throw new GaussianSplatError('decode/unsupported', {
    where: `${name}, frames`,
    expected: `addresses, absolute or relative to ${url.slice(0, 200)}`,
    found: JSON.stringify(path.slice(0, 80)),
    remedy: 'serve the manifest beside its frames, or write whole addresses into it',
  });
}
