import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { asGiven, economise, type Economised, type EconomiseOptions } from './economise.js';
import { readInParts } from './parts/read-in-parts.js';
import { inline } from './parts/task-pool.js';

/** Result of a search for a PSNR target. */
export interface EconomisedBySearch extends Economised {
  /** PSNR target in dB with which the file was written. */
  readonly minPsnr: number;
}

/** Default PSNR target of the first try, in dB. */
export const FIRST_PSNR = 45;
const MIN_PSNR = 15;
const MAX_TRIES = 7;
/** Fraction of the allowed bytes that ends the search for a size. */
const FULL_ENOUGH = 0.97;

type SearchOptions = Omit<EconomiseOptions, 'minPsnr'>;

/** Assessment of a file during a search. */
interface Verdict {
  readonly isAccepted: boolean;
  /** Direction of the next PSNR target. Undefined ends the search. */
  readonly next?: 'lower' | 'higher';
  /** Text for {@link EconomiseOptions.onStep}. */
  readonly description: string;
}

/** PSNR targets of a search, in dB. */
interface Range {
  readonly first: number;
  /** Difference between consecutive targets, until one target is too low and another is too high. */
  readonly step: number;
  /** Difference between the targets that are too low and too high that ends the search. */
  readonly nearEnough: number;
}

/**
 * Searches the PSNR target of {@link economise} by bisection.
 * @returns The last accepted file; undefined if no file was accepted.
 * @throws the last error of {@link economise} if it has written no file.
 */
async function searchDecibels(
  cloud: GaussianCloud,
  options: SearchOptions,
  judge: (found: Economised) => Verdict | Promise<Verdict>,
  { first, step, nearEnough }: Range,
): Promise<EconomisedBySearch | undefined> {
  let [low, high] = [-Infinity, Infinity];
  let best: EconomisedBySearch | undefined;
  let refusal: unknown;
  let isJudged = false;
  let minPsnr = first;
  for (let tries = 0; tries < MAX_TRIES && minPsnr >= MIN_PSNR && high - low > nearEnough; tries++) {
    const found = await economise(cloud, { ...options, minPsnr }).catch((error: unknown) => {
      refusal = error;
      return undefinedIfBeyondFormat(error);
    });
    isJudged ||= found !== undefined;
    const { isAccepted, next, description } = found ? await judge(found) : BEYOND_FORMAT;
    options.onStep?.(`${minPsnr.toFixed(1)} dB: ${description}`);
    if (found && isAccepted) best = { ...found, minPsnr };
    if (next === undefined) break;
    if (next === 'higher') low = minPsnr;
    else high = minPsnr;
    if (low === -Infinity) minPsnr = high - step;
    else minPsnr = high === Infinity ? low + step : (low + high) / 2;
  }
  if (refusal !== undefined && !isJudged) throw refusal;
  return best;
}

/**
 * Returns the most accurate file of at most `maxBytes`, by bisection of the PSNR target of {@link economise}.
 * @throws GaussianSplatError `argument/value` if no file of 15 dB or more is that small.
 */
export async function economiseWithin(
  cloud: GaussianCloud,
  maxBytes: number,
  options: SearchOptions,
): Promise<EconomisedBySearch> {
  const judge = ({ bytes: { length } }: Economised): Verdict => {
    const isAccepted = length <= maxBytes;
    const description = `${length} bytes`;
    if (isAccepted && length >= FULL_ENOUGH * maxBytes) return { isAccepted, description };
    return { isAccepted, next: isAccepted ? 'higher' : 'lower', description };
  };
  const best = await searchDecibels(cloud, options, judge, { first: FIRST_PSNR, step: 6, nearEnough: 0 });
  if (best) return best;
  throw new GaussianSplatError('argument/value', {
    where: options.name,
    expected: `a size that has room for the scene at ${MIN_PSNR} dB`,
    found: `${(maxBytes / 1e6).toFixed(2)} MB`,
    remedy: 'allow more bytes, or choose .sog, the smallest format',
  });
}

/**
 * Tests a file by other means than {@link economise}, for example against photographs.
 * @param written Scene that was read from the file, in the coordinates of the source.
 */
export type JudgeFile = (written: GaussianCloud) => Promise<{
  readonly passes: boolean;
  /** Description of the measurements for {@link EconomiseOptions.onStep}. */
  readonly description: string;
}>;

/**
 * Returns a small file that passes a test, by bisection of the PSNR target of {@link economise} to 0.5 dB.
 * @param first PSNR target of the first try, in dB.
 * @throws GaussianSplatError `argument/value` if none of the files passes.
 */
export async function economisePassing(
  cloud: GaussianCloud,
  judge: JudgeFile,
  options: SearchOptions,
  first = FIRST_PSNR,
): Promise<EconomisedBySearch> {
  let last = 'no file that the format can hold';
  const judged = async ({ bytes }: Economised): Promise<Verdict> => {
    const { name, signal, pool = inline } = options;
    const written = asGiven(await readInParts(bytes, { name, signal }, pool), cloud);
    const { passes, description } = await judge(written);
    last = description;
    return {
      isAccepted: passes,
      next: passes ? 'lower' : 'higher',
      description: `${bytes.length} bytes, ${description}`,
    };
  };
  const best = await searchDecibels(cloud, options, judged, { first, step: 3, nearEnough: 0.5 });
  if (best) return best;
  throw new GaussianSplatError('argument/value', {
    where: options.name,
    expected: 'a file that passes the gate',
    found: last,
    remedy: 'write a more precise format (.ply or .glb)',
  });
}

/** Assessment if the format cannot reach a PSNR target: the next target is lower. */
const BEYOND_FORMAT: Verdict = { isAccepted: false, next: 'lower', description: 'beyond the format' };

function undefinedIfBeyondFormat(error: unknown): undefined {
  if (error instanceof GaussianSplatError && error.code === 'argument/value') return undefined;
  throw error;
}
