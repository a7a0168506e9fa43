/** Serializes errors of threads, because structured clone drops their classes and fields. */
import { GaussianSplatError } from '@gaussian-splat/core';

/** Converts an error to plain data. */
export function packError(error) {
  const { message, code } = error;
  return error instanceof GaussianSplatError ? { data: error.toData() } : { message, code };
}

/** Converts the plain data of {@link packError} to an error. */
export function unpackError({ data, message, code }) {
  return data ? GaussianSplatError.fromData(data) : Object.assign(new Error(message), { code });
}
