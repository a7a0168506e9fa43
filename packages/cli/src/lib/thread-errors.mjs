/** Errors on their way from a thread: structured clone drops their classes and fields. */
import { GaussianSplatError } from '@gaussian-splat/core';

/** An error as plain data. */
export function packError(error) {
  const { message, code } = error;
  return error instanceof GaussianSplatError ? { data: error.toData() } : { message, code };
}

/** The error that was packed. */
export function unpackError({ data, message, code }) {
  return data ? GaussianSplatError.fromData(data) : Object.assign(new Error(message), { code });
}
