/** Serializes errors of threads, because structured clone drops their classes and fields. */
import { GaussianSplatError } from '@gaussian-splat/core';

/** An error as plain data. */
export function packError(error) {
  const { message, code } = error;
  return error instanceof GaussianSplatError ? { data: error.toData() } : { message, code };
}

/** Restores a serialized error. */
export function unpackError({ data, message, code }) {
  return data ? GaussianSplatError.fromData(data) : Object.assign(new Error(message), { code });
}
