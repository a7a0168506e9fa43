import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { economise, type Economised, type EconomiseOptions } from './economise.js';

export interface EconomisedWithin extends Economised {
  /** PSNR target of the search, dB. */
  readonly minDecibels: number;
}

/** Initial PSNR of the search, dB. */
export const FIRST_DECIBELS = 45;
const MIN_PSNR = 15;
const DECIBELS_STEP = 6;
const MAX_TRIES = 7;
/** The search ends at this fraction of the bytes. */
const FULL_ENOUGH = 0.97;

/**
 * Finds the most accurate file of at most `maxBytes`: bisects the PSNR of {@link compressScene}.
 * @throws GaussianSplatError `argument/value` if no file of 15 dB or more is that small.
 */
export async function economiseWithin(
  cloud: GaussianCloud,
  maxBytes: number,
  options: Omit<EconomiseOptions, 'minDecibels'>,
): Promise<EconomisedWithin> {
  let [low, high] = [-Infinity, Infinity];
  let best: EconomisedWithin | undefined;
  let minDecibels = FIRST_DECIBELS;
  for (let tries = 0; tries < MAX_TRIES && minDecibels >= MIN_PSNR; tries++) {
    const found = await economise(cloud, { ...options, minDecibels }).catch(undefinedIfBeyondFormat);
    const outcome = found ? `${found.bytes.length} bytes` : 'beyond the format';
    options.onStep?.(`${minDecibels.toFixed(1)} dB: ${outcome}`);
    if (found && found.bytes.length <= maxBytes) {
      best = { ...found, minDecibels };
      low = minDecibels;
      if (found.bytes.length >= FULL_ENOUGH * maxBytes) break;
    } else high = minDecibels;
    if (low === -Infinity) minDecibels = high - DECIBELS_STEP;
    else minDecibels = high === Infinity ? low + DECIBELS_STEP : (low + high) / 2;
  }
  if (best) return best;
  throw new GaussianSplatError('argument/value', {
    where: options.name,
    expected: `a size that has room for the scene at ${MIN_PSNR} dB`,
    found: `${(maxBytes / 1e6).toFixed(2)} MB`,
    remedy: 'allow more bytes, or choose .sog, the smallest format',
  });
}

/** A PSNR that the format cannot reach counts as too many bytes. */
function undefinedIfBeyondFormat(error: unknown): undefined {
  if (error instanceof GaussianSplatError && error.code === 'argument/value') return undefined;
  throw error;
}
