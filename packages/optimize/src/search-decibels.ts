import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { asGiven, optimize, type Optimized, type OptimizeOptions } from './optimize.js';
import { readInParts } from './parts/read-in-parts.js';
import { inline } from './parts/task-pool.js';

/** Result of a search for a PSNR target. */
export interface OptimizedBySearch extends Optimized {
  /** PSNR target in dB with which the file was written. */
  readonly minPsnr: number;
}

/** Default PSNR target of the first try, in dB. */
export const FIRST_PSNR = 45;
const MIN_PSNR = 15;
const MAX_TRIES = 7;
/** Fraction of the allowed bytes that ends the search for a size. */
const FULL_ENOUGH = 0.97;

/** Difference in dB between targets of a search for a size, until one is too low and another is too high. */
const SIZE_STEP = 6;

const BEYOND = 'beyond the format';

type SearchOptions = Omit<OptimizeOptions, 'minPsnr'>;

/**
 * Returns the most accurate file of at most `maxBytes`, by bisection of the PSNR target of {@link optimize}.
 * @throws GaussianSplatError `argument/value` if no file of 15 dB or more is that small, or the last error of
 * {@link optimize} if it has written no file
 */
export async function optimizeWithin(
  cloud: GaussianCloud,
  maxBytes: number,
  options: SearchOptions,
): Promise<OptimizedBySearch> {
  let [low, high, minPsnr] = [-Infinity, Infinity, FIRST_PSNR];
  let [best, refusal, hasFile]: [OptimizedBySearch | undefined, unknown, boolean] = [undefined, undefined, false];
  for (let tries = 0; tries < MAX_TRIES && minPsnr >= MIN_PSNR; tries++) {
    const found = await optimize(cloud, { ...options, minPsnr }).catch((error: unknown) => {
      refusal = error;
      return undefinedIfBeyondFormat(error);
    });
    hasFile ||= found !== undefined;
    const length = found?.bytes.length ?? Infinity;
    options.onStep?.(`${minPsnr.toFixed(1)} dB: ${found ? `${length} bytes` : BEYOND}`);
    if (found && length <= maxBytes) [best, low] = [{ ...found, minPsnr }, minPsnr];
    else high = minPsnr;
    if (low === minPsnr && length >= FULL_ENOUGH * maxBytes) break;
    if (low === -Infinity) minPsnr = high - SIZE_STEP;
    else minPsnr = high === Infinity ? low + SIZE_STEP : (low + high) / 2;
  }
  if (refusal !== undefined && !hasFile) throw refusal;
  if (best) return best;
  throw new GaussianSplatError('argument/value', {
    where: options.name,
    expected: `a size that has room for the scene at ${MIN_PSNR} dB`,
    found: `${(maxBytes / 1e6).toFixed(2)} MB`,
    remedy: 'allow more bytes, or choose .sog, the smallest format',
  });
}

/**
 * Tests a file by other means than {@link optimize}, for example against photographs.
 * @param written Scene that was read from the file, in the coordinates of the source.
 */
export type JudgeFile = (written: GaussianCloud) => Promise<{
  /** `undecided`: the measurements cannot distinguish between the others. It does not count as a pass. */
  readonly verdict: 'passes' | 'undecided' | 'fails';
  /** Description of the measurements for {@link OptimizeOptions.onStep}. */
  readonly description: string;
}>;

/** A PSNR target that was tried, and the verdict about its file. */
export interface Try {
  readonly minPsnr: number;
  readonly verdict: 'passes' | 'undecided' | 'fails' | typeof BEYOND;
  readonly bytes?: number;
  readonly description: string;
}

/** Result of {@link optimizePassing}, with all tries in the order of their targets, the highest first. */
export interface OptimizedPassing extends OptimizedBySearch {
  readonly tries: readonly Try[];
}

/** Difference in dB between targets of the search, and the difference that ends the search. */
const [TARGET_STEP, NEAR_ENOUGH] = [2, 0.5];
const MAX_TARGETS = 10;

/**
 * Returns the smallest file that passes a test together with all files of higher PSNR targets that were tried. Passes are
 * not monotonic: noise lets a file pass among others that fail. Targets therefore descend from one above `first` until a
 * file does not pass, and ascend until the two highest pass. The interval below the lowest pass is divided to 0.5 dB.
 * @param first Expected PSNR target in dB.
 * @throws GaussianSplatError `argument/value` if the highest targets do not pass.
 */
export async function optimizePassing(
  cloud: GaussianCloud,
  judge: JudgeFile,
  options: SearchOptions,
  first = FIRST_PSNR,
): Promise<OptimizedPassing> {
  const { name, signal, pool = inline, onStep } = options;
  const tries: Try[] = [];
  const files = new Map<number, Optimized>();
  let refusal: unknown;
  const tryAt = async (minPsnr: number): Promise<Try> => {
    const found = await optimize(cloud, { ...options, minPsnr }).catch((error: unknown) => {
      refusal = error;
      return undefinedIfBeyondFormat(error);
    });
    const made = found && (await judge(asGiven(await readInParts(found.bytes, { name, signal }, pool), cloud)));
    const one: Try =
      found && made
        ? { minPsnr, bytes: found.bytes.length, ...made }
        : { minPsnr, verdict: BEYOND, description: BEYOND };
    if (found && one.verdict === 'passes') files.set(minPsnr, found);
    tries.push(one);
    onStep?.(`${minPsnr.toFixed(1)} dB: ${one.bytes === undefined ? '' : `${one.bytes} bytes, `}${one.description}`);
    return one;
  };
  await climb(tryAt, tries, first);
  tries.sort((a, b) => b.minPsnr - a.minPsnr);
  // A lower target may need a larger file: its cut is found in fewer tries.
  const passing = runOf(tries).filter(({ minPsnr }) => files.has(minPsnr));
  const smallest = passing.sort((a, b) => a.bytes! - b.bytes!)[0];
  if (smallest) return { ...files.get(smallest.minPsnr)!, minPsnr: smallest.minPsnr, tries };
  if (refusal !== undefined && tries.every(({ bytes }) => bytes === undefined)) throw refusal;
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: 'files that pass the gate at a PSNR target and all higher ones',
    found: tries.map(({ minPsnr, description }) => `${minPsnr.toFixed(1)} dB ${description}`).join('; '),
    remedy: tries.some(({ verdict }) => verdict === 'undecided')
      ? 'give more photographs, which decide what a few cannot, or write a more precise format (.ply or .glb)'
      : 'write a more precise format (.ply or .glb)',
  });
}

/**
 * Tries targets: down from one step above `first` while files pass, up until the two highest pass or the format holds
 * nothing higher, and then in the interval below the lowest pass.
 */
async function climb(tryAt: (minPsnr: number) => Promise<Try>, tries: readonly Try[], first: number): Promise<void> {
  const isLeft = (): boolean => tries.length < MAX_TARGETS;
  const sorted = (): Try[] => [...tries].sort((a, b) => b.minPsnr - a.minPsnr);
  let next = first + TARGET_STEP;
  for (let isDown = true; isDown && isLeft() && next >= MIN_PSNR; next -= TARGET_STEP) {
    const { verdict } = await tryAt(next);
    isDown = verdict === 'passes' || (verdict === BEYOND && tries.every((one) => one.verdict === BEYOND));
  }
  while (isLeft()) {
    const [top, second] = sorted();
    if (top.verdict === BEYOND || (top.verdict === 'passes' && second?.verdict === 'passes')) break;
    await tryAt(top.minPsnr + TARGET_STEP);
  }
  while (isLeft()) {
    const targets = sorted();
    const lowest = runOf(targets).at(-1);
    const below = lowest && targets.find(({ minPsnr }) => minPsnr < lowest.minPsnr);
    if (!lowest || !below || lowest.minPsnr - below.minPsnr <= NEAR_ENOUGH) break;
    await tryAt((lowest.minPsnr + below.minPsnr) / 2);
  }
}

/**
 * Returns the run of passes that begins with the highest target within the format; empty if the highest does not pass.
 * @param tries Descending targets.
 */
function runOf(tries: readonly Try[]): Try[] {
  const within = tries.filter(({ verdict }) => verdict !== BEYOND);
  const end = within.findIndex(({ verdict }) => verdict !== 'passes');
  return within.slice(0, end < 0 ? within.length : end);
}

function undefinedIfBeyondFormat(error: unknown): undefined {
  if (error instanceof GaussianSplatError && error.code === 'argument/value') return undefined;
  throw error;
}
