import { GaussianSplatError } from '@gaussian-splat/core';

/** The error for a file whose parts contradict one another. All arguments are phrases as `ErrorDetails` describes. */
export function damaged(
  where: string,
  expected: string,
  found: string,
  code: 'decode/header' | 'decode/corrupt' | 'decode/unsupported' | 'decode/truncated' = 'decode/corrupt',
  cause?: unknown,
): GaussianSplatError {
  const remedy =
    code === 'decode/unsupported'
      ? 'export the scene again in another variant, for example as SPZ or PLY'
      : 'download or export the file again; it is damaged or incomplete';
  return new GaussianSplatError(code, { where, expected, found, remedy, cause });
}
