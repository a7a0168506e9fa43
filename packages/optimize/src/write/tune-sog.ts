import { GaussianSplatError, shCoefficientCount } from '@gaussian-splat/core';
import type { SplatVisibility } from '../pages/splat-visibility.js';
import { findSteps, scaledSteps } from '../steps.js';
import type { Encoding, Measure, WrittenCloud } from './index.js';
import type { Palette } from './palette.js';
import { writeSog, type EncodeWebp, type SogOptions, type SogSteps } from './sog.js';
import { writeStreamedSog } from './streamed-sog.js';
import { writeZip } from './zip.js';

const USUAL: SogSteps = { place: 4, size: 1 / 12, turn: 4, opacity: 4, color: 1 / 32, harmonics: 1 / 64 };
/** Settings of a SOG file that measurements select. */
export interface SogChoice {
  readonly steps: SogSteps;
  readonly palette: number;
}

/** Number of values of a splat that each step quantizes. Harmonics depend on the palette; about half of them are 0. */
const NUMBERS: Omit<SogSteps, 'harmonics'> = { place: 3, size: 3, turn: 3, opacity: 1, color: 3 };
/** Finest steps that files support, in the units of {@link SogSteps}. */
const FINEST: SogSteps = { place: 1, size: 1e-3, turn: 1, opacity: 1, color: 1e-3, harmonics: 1e-3 };
const PALETTES = [1024, 4096, 8192, 16_384, 32_768, 65_536];
/** Maximum fraction of the allowed error that the palette may cause, unless it is the largest palette. */
const PALETTE_SHARE = 0.4;
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
  let rest = target;
  if (cloud.shDegree > 0) {
    for (palette of PALETTES) {
      const error = await errorOf(FINEST, palette);
      rest = target - error;
      if (error <= PALETTE_SHARE * target) break;
    }
  }
  const min = (1 - PALETTE_SHARE) * target * 0.25;
  const share = cloud.shDegree > 0 ? Math.max(min, rest) : target;
  const ofPalette = 1.5 * (shCoefficientCount(cloud.shDegree) - 1) * Math.min(1, palette / cloud.count);
  const numbers = ofPalette > 0 ? { ...NUMBERS, harmonics: ofPalette } : NUMBERS;
  const { steps } = await findSteps({
    ...{ usual: USUAL, numbers, share, target, nearEnough: NEAR_ENOUGH },
    measure: (tried) => errorOf(tried, palette),
  });
  return { steps, palette, encodeWebp, seen };
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
