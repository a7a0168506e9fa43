import { GaussianSplatError, shCoefficientCount } from '@gaussian-splat/core';
import type { SplatVisibility } from '../pages/splat-visibility.js';
import { findSteps, scaledSteps } from '../steps.js';
import type { Encoding, Measure, WrittenCloud } from './index.js';
import type { Palette } from './palette.js';
import { writeSog, type EncodeWebp, type SogOptions, type SogSteps } from './sog.js';
import { writeStreamedSog } from './streamed-sog.js';
import { writeZip } from './zip.js';

const USUAL: Omit<SogSteps, 'place'> = { size: 1 / 12, turn: 4, opacity: 4, color: 1 / 32, harmonics: 1 / 64 };
/** Settings of a SOG file that measurements select. */
export interface SogChoice {
  readonly steps: SogSteps;
  readonly palette: number;
}

/** Number of values of a splat that each step quantizes. Harmonics depend on the palette; about half of them are 0. */
const NUMBERS: Omit<SogSteps, 'harmonics' | 'place'> = { size: 3, turn: 3, opacity: 1, color: 3 };
const PLACE_NUMBERS = 3;
const MAX_PLACE = 256;
/** Finest steps that files support, in the units of {@link SogSteps}. */
const FINEST: SogSteps = { place: 1, size: 1e-3, turn: 1, opacity: 1, color: 1e-3, harmonics: 1e-3 };
const PALETTES = [1024, 4096, 8192, 16_384, 32_768, 65_536];
/** Maximum fraction of the allowed error that the palette may cause, unless it is the largest palette. */
const PALETTE_SHARE = 0.4;
/** Minimum fraction of the allowed error that is left to steps other than `place`. */
const MIN_REST = 0.2;
/** The search for steps ends when the error reaches this fraction of the allowed error. */
const NEAR_ENOUGH = 0.9;
/** Effort of {@link EncodeWebp} for temporary files that are only measured. */
const QUICK = 0;

/**
 * Returns a SOG encoding whose `tune` selects the coarsest steps and palette within an error limit.
 * @param encodeWebp If undefined, `tune` throws GaussianSplatError `argument/value`. The encoding returned here always
 * throws it in `write`, before `tune`.
 * @param isStreamed Whether to write an archive of an index and files by level of detail. The steps are measured on one
 * SOG file in either case.
 */
export function tuneSog(encodeWebp: EncodeWebp | undefined, isStreamed = false): Encoding {
  return {
    title: isStreamed ? 'streamed SOG' : 'SOG version 2',
    hasOneDegree: true,
    write: () => {
      throw withoutWebp();
    },
    finest: ({ shDegree }) => {
      if (encodeWebp === undefined) throw withoutWebp();
      return tunedSog({ steps: FINEST, palette: PALETTES.at(-1)!, encodeWebp }, shDegree > 0, isStreamed);
    },
    tune: async (whole, measure, target, seen) => {
      if (encodeWebp === undefined) throw withoutWebp();
      const options = await tuned(whole, measure, target, encodeWebp, seen);
      return tunedSog(options, whole.cloud.shDegree > 0, isStreamed);
    },
  };
}

function tunedSog(options: SogOptions, hasHarmonics: boolean, isStreamed: boolean): Encoding {
  const { steps, palette, seen } = options;
  const applicable = Object.entries(steps).filter(([name]) => hasHarmonics || name !== 'harmonics');
  const list = applicable.map(([name, step]) => `${name} ${step.toPrecision(2)}`).join(', ');
  const title = `SOG version 2, steps ${list}${hasHarmonics ? `, palette ${palette}` : ''}`;
  return {
    title: `${isStreamed ? 'streamed ' : ''}${title}`,
    hasOneDegree: true,
    sog: { steps, palette },
    write: async ({ cloud, kept }) => {
      const own = { ...options, seen: seen && kept ? splatsSeen(seen, kept) : seen };
      return isStreamed ? writeZip(await writeStreamedSog(cloud, own)) : writeSog(cloud, own);
    },
    coarser: (factor) => tunedSog({ ...options, steps: scaledSteps(steps, factor) }, hasHarmonics, isStreamed),
  };
}

/** Returns the encoding that {@link tuneSog} selected before. */
export const sogOf = (choice: SogChoice, encodeWebp: EncodeWebp): Encoding =>
  tunedSog({ ...choice, encodeWebp }, true, false);

async function tuned(
  { cloud }: WrittenCloud,
  measure: Measure,
  target: number,
  encodeWebp: EncodeWebp,
  seen: SplatVisibility | undefined,
): Promise<SogOptions> {
  const palettes = new Map<number, Palette>();
  const errorOf = async (steps: SogSteps, palette: number): Promise<number> =>
    measure(await writeSog(cloud, { steps, palette, encodeWebp, effort: QUICK, seen, palettes }));
  let palette = PALETTES[0];
  if (cloud.shDegree > 0) {
    for (palette of PALETTES) if ((await errorOf(FINEST, palette)) <= PALETTE_SHARE * target) break;
  }
  const ofPalette = 1.5 * (shCoefficientCount(cloud.shDegree) - 1) * Math.min(1, palette / cloud.count);
  const numbers = ofPalette > 0 ? { ...NUMBERS, harmonics: ofPalette } : NUMBERS;
  const others = Object.values(numbers).reduce((sum, count) => sum + count, 0);
  const { place, error } = await placeStep((own) => errorOf({ ...FINEST, place: own }, palette), target, others);
  // If no step of positions is fine enough, finer ones of other attributes help little.
  const rest = Math.max(target - error, MIN_REST * Math.max(target, error));
  const { steps } = await findSteps({
    ...{ usual: USUAL, numbers, share: rest, target: Math.max(target, error + rest), nearEnough: NEAR_ENOUGH },
    measure: (tried: Omit<SogSteps, 'place'>) => errorOf({ ...tried, place }, palette),
  });
  return { steps: { ...steps, place }, palette, encodeWebp, seen };
}

/**
 * Returns the step of positions, a power of two, with which all steps together take the fewest bits, and its error. It is
 * measured with the finest other steps: it grows irregularly, because splats of nearly equal depth exchange their order.
 * @param measure Returns the error with a step of positions.
 * @param target Allowed error of all steps.
 * @param others Number of other values of a splat. Their error is proportional to the square of their steps.
 */
async function placeStep(
  measure: (place: number) => Promise<number>,
  target: number,
  others: number,
): Promise<{ readonly place: number; readonly error: number }> {
  let best = { place: 1, error: await measure(1) };
  const bitsOf = ({ place, error }: typeof best): number =>
    -PLACE_NUMBERS * Math.log2(place) - (others / 2) * Math.log2(Math.max(target - error, 1e-9 * target));
  for (let place = 2; place <= MAX_PLACE; place *= 2) {
    const next = { place, error: await measure(place) };
    if (bitsOf(next) < bitsOf(best)) best = next;
    if (next.error > (1 - MIN_REST) * target) break;
  }
  return best;
}

/** Returns the visibility of the splats with the indices `kept`. */
function splatsSeen({ energies, roots }: SplatVisibility, kept: Uint32Array): SplatVisibility {
  const numbers = roots.length / energies.length;
  const own = new Float32Array(numbers * kept.length);
  kept.forEach((i, k) => own.set(roots.subarray(numbers * i, numbers * (i + 1)), numbers * k));
  return { energies: Float32Array.from(kept, (i) => energies[i]), roots: own };
}

const withoutWebp = (): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'SOG',
    expected: 'an encoder of lossless WebP',
    found: 'none',
    remedy: 'pass encodeWebp, or use the command gaussian-splat optimize, which has one',
  });
