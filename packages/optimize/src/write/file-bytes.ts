import { GaussianSplatError } from '@gaussian-splat/core';

/** Maximum of the lengths and counts that GLB, SPZ and ZIP store in 32 bits. */
export const MAX_UINT32 = 2 ** 32 - 1;

/**
 * Throws `argument/value` if a file would need a larger number than its format can store.
 * @param format Name of the format for the error.
 * @param what Unit of the number, such as `bytes`.
 */
export function requireAtMost(format: string, value: number, max: number, what: string): void {
  if (value <= max) return;
  throw new GaussianSplatError('argument/value', {
    where: `scene that is written as ${format}`,
    expected: `at most ${max.toLocaleString('en')} ${what}, which is the maximum of the format`,
    found: value.toLocaleString('en'),
    remedy: 'write fewer splats, divide the scene, or choose .ply, which has no such maximum',
  });
}

/**
 * Allocates the bytes of a file, filled with zeros.
 * @param format Name of the format for the error.
 * @throws GaussianSplatError `out-of-memory/allocation`
 */
export function fileBytes<Memory extends ArrayBufferLike = ArrayBuffer>(
  format: string,
  byteLength: number,
  allocate = (length: number): Memory => new ArrayBuffer(length) as Memory,
): Uint8Array<Memory> {
  try {
    return new Uint8Array(allocate(byteLength));
  } catch (cause) {
    if (!(cause instanceof RangeError)) throw cause;
    throw new GaussianSplatError('out-of-memory/allocation', {
      where: `scene that is written as ${format}`,
      expected: `memory for ${byteLength.toLocaleString('en')} bytes`,
      found: 'an allocation that failed',
      remedy: 'write fewer splats, or divide the scene',
      cause,
    });
  }
}
