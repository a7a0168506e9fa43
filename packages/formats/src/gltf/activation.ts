/**
 * Conversion of splats whose accessors contain logarithms, logits, or coordinates that `KHR_gaussian_splatting` does not
 * specify. Tools wrote such files while the extension was a draft, and some still do.
 */
import type { GaussianCloud } from '@gaussian-splat/core';
import { expInPlace, sigmoidInPlace, type DraftCloud } from '../cloud.js';
import { warn } from '../faults.js';
import { isObject } from '../json.js';
import type { Json } from './container.js';

/** Encoding of all uncompressed splats of a document: logarithms in place of scales, logits in place of opacities. */
export interface Activation {
  readonly hasLogarithms: boolean;
  readonly hasLogits: boolean;
  /** Whether positions and rotations are in the coordinates of PLY. */
  readonly isInPlyFrame: boolean;
}

/** Distance of opacities from 0..1 that is considered a rounding error. */
const ROUNDING = 1e-3;

/**
 * Infers the encoding of a document. The extension forbids scales below 0 and opacities outside 0..1, so that a single
 * such value proves logarithms or logits. Documents of splat-transform up to version 2.3 have logarithms. Those of its
 * version 1 and of gsbox also have the coordinates of PLY.
 * @param json JSON of the glTF, whose `asset.generator` names the program that wrote it.
 * @param clouds Scales and opacities of all uncompressed splats, as stored in the accessors.
 */
export function activationOf(json: Json, clouds: readonly Pick<GaussianCloud, 'scales' | 'opacities'>[]): Activation {
  const { asset } = json;
  const generator = isObject(asset) && typeof asset.generator === 'string' ? asset.generator : '';
  const [, major, minor] = /splat-transform v?(\d+)\.(\d+)/.exec(generator) ?? [];
  const isEarly = major !== undefined && (Number(major) < 2 || (Number(major) === 2 && Number(minor) <= 3));
  const hasLogarithms = isEarly || clouds.some(({ scales }) => scales.some((scale) => scale < 0));
  return {
    hasLogarithms,
    hasLogits: clouds.some(({ opacities }) => opacities.some((value) => value < -ROUNDING || value > 1 + ROUNDING)),
    isInPlyFrame: hasLogarithms && (major === '1' || /^gsbox\b/i.test(generator)),
  };
}

/** Whether the encoding matches the specification. */
export const isPlain = ({ hasLogarithms, hasLogits }: Activation): boolean => !hasLogarithms && !hasLogits;

/** Converts stored values of a cloud to scales and opacities in place, and adds a warning if they differed. */
export function activate(cloud: DraftCloud, { hasLogarithms, hasLogits }: Activation): void {
  if (hasLogarithms) expInPlace(cloud.scales);
  if (hasLogits) sigmoidInPlace(cloud.opacities);
  const found = [
    ...(hasLogarithms ? ['logarithms in place of scales'] : []),
    ...(hasLogits ? ['logits in place of opacities'] : []),
  ];
  if (found.length > 0)
    warn(cloud, `The glTF has ${found.join(' and ')}, which KHR_gaussian_splatting forbids. They are converted.`);
}
