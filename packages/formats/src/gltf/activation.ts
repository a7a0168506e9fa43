/**
 * Splats whose accessors hold logarithms, logits or other coordinates than the extension specifies: tools wrote such
 * files while it was a draft, and some still do.
 */
import type { GaussianCloud } from '@gaussian-splat/core';
import { expInPlace, sigmoidInPlace, type DraftCloud } from '../cloud.js';
import { warn } from '../faults.js';
import { isObject } from '../json.js';
import type { Json } from './container.js';

/** Encoding of all uncompressed splats of a document. */
export interface Activation {
  readonly hasLogarithms: boolean;
  readonly hasLogits: boolean;
  /** Whether positions and rotations are in the coordinates of PLY. */
  readonly isInPlyFrame: boolean;
}

/** Tolerance of opacities outside 0..1. */
const ROUNDING = 1e-3;

/**
 * Infers the encoding. The extension forbids scales below 0 and opacities outside 0..1, so a single one proves
 * logarithms or logits. splat-transform wrote logarithms before June 2026, up to version 2.3 with any sign, and version
 * 1 wrote the coordinates of PLY, as gsbox does.
 * @param clouds Uncompressed splats with the values of the accessors.
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

/** Converts the values of the accessors to scales and opacities, in place. */
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
