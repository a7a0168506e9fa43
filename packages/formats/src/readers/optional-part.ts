import { GaussianSplatError } from '@gaussian-splat/core';

/**
 * Returns the content of a file that a scene can do without, or why there is none: it is missing or cannot be read.
 * @throws GaussianSplatError `out-of-memory/...`; the reason of `signal`
 */
export function optionalPart<T>(asked: Promise<T>, signal: AbortSignal | undefined): Promise<T | Error> {
  return asked.catch((error: unknown) => {
    signal?.throwIfAborted();
    if (error instanceof GaussianSplatError && error.code.startsWith('out-of-memory')) throw error;
    return error as Error;
  });
}
