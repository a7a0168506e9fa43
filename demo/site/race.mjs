/** Times and accuracies of renderers in one report of the frontier page, as people compare them: for the build and for pages. */
import { timeOf } from '../../scripts/frontier/front.mjs';

/** Visibility of a difference in dB to the eye. */
const TO_THE_EYE = [
  [59, 'no difference on a display'],
  [42, 'hardly visible'],
  [36, 'visible beside the original'],
  [0, 'visible'],
];
const OTHERS = ['PlayCanvas', 'Spark'];

/**
 * Rows of a race, each with its fraction of the longest time (`share`).
 * @param report {{ results: object[], standard?: object }}
 * @param names {readonly string[]} configurations in the order of the rows; missing ones are left out.
 */
export function raceOf({ results, standard }, names) {
  const rows = names.flatMap((name) => {
    const result = results.find(({ configuration, error }) => configuration.name === name && !error);
    return result ? [{ name, ms: timeOf(result, standard), psnr: result.quality.psnr }] : [];
  });
  const max = Math.max(...rows.map(({ ms }) => ms));
  return rows.map(({ name, ms, psnr }) => ({
    name,
    isOther: OTHERS.includes(name),
    milliseconds: ms < 10 ? ms.toPrecision(2) : Math.round(ms).toLocaleString('en'),
    share: (ms / max).toFixed(3),
    decibels: psnr.toFixed(0),
    eye: TO_THE_EYE.find(([min]) => psnr >= min)[1],
  }));
}
