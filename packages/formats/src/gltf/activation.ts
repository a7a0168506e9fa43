/** Splats whose accessors hold logarithms, logits or another frame than the extension asks for: tools wrote such files while it was a draft, and some still do. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { expInPlace, sigmoidInPlace, type DraftCloud } from '../cloud.js';
import { warn } from '../faults.js';
import { isObject } from '../json.js';
import type { Json } from './container.js';

/** How the numbers of all uncompressed splats of a document are meant. */
export interface Activation {
  readonly hasLogarithms: boolean;
  readonly hasLogits: boolean;
  /** Positions and rotations are in the frame of PLY. */
  readonly isInPlyFrame: boolean;
}

/** Opacities beyond 0..1 by less are rounding. */
const ROUNDING = 1e-3;

/**
 * The extension forbids scales below 0 and opacities outside of 0..1: one of them proves that all are logarithms or logits. splat-transform wrote logarithms before June 2026, up to
 * version 2.3 whatever their sign, and version 1 wrote the frame of PLY, as gsbox does.
 * @param clouds uncompressed splats as the accessors have them
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

/** Whether nothing of it needs a change. */
export const isPlain = ({ hasLogarithms, hasLogits }: Activation): boolean => !hasLogarithms && !hasLogits;

/** Makes scales and opacities of what the accessors hold, in place. */
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
