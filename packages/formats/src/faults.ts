/**
 * Reports of faults in a file. {@link damaged} creates the error that ends the load, and {@link warn} adds a warning about
 * content that is not drawn exactly. The reader of plain PLY does not load this module.
 */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { DraftCloud } from './cloud.js';

/**
 * Returns the error for a damaged file or one of an unsupported variant. `where`, `expected` and `found` are phrases as
 * `ErrorDetails` describes.
 */
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

/** Returns the error for a file whose header declares no splats, at the place `where`. */
export const noSplatsAt = (where: string): GaussianSplatError =>
  new GaussianSplatError('decode/empty', {
    where,
    expected: '1 splat or more',
    found: '0',
    remedy: 'export the scene again; this file is empty',
  });

/** Warning for spherical harmonics of degree 4, which are truncated to degree 3. */
export const DEGREE_4 =
  'Spherical harmonics of degree 4 are drawn up to degree 3; the finest changes of color with direction are left out.';

/** Warning for 2D Gaussians. */
export const FLAT =
  'The splats are 2D Gaussians (2DGS). They are drawn as flat 3D Gaussians: edges and thin parts look a little wider and paler than 2DGS draws them.';

/** Adds a warning to a cloud, unless the cloud has the same one. */
export function warn(cloud: DraftCloud, sentence: string): void {
  const { warnings = [] } = cloud;
  if (!warnings.includes(sentence)) cloud.warnings = [...warnings, sentence];
}
