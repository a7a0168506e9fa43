import { GaussianSplatError } from '@gaussian-splat/core';

/**
 * Returns the bytes of a file that a scene can do without, or why there are none: it is missing or cannot be fetched.
 * @throws GaussianSplatError `out-of-memory/...`; the reason of `signal`
 */
export function optionalPart(asked: Promise<Uint8Array>, signal: AbortSignal | undefined): Promise<Uint8Array | Error> {
  return asked.catch((error: unknown) => {
    signal?.throwIfAborted();
    if (error instanceof GaussianSplatError && error.code.startsWith('out-of-memory')) throw error;
    return error as Error;
  });
}
