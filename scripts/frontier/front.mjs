/** Which configurations are worth having: those that no other one beats in both time and accuracy. */

/**
 * Points that no other point dominates, by ascending time. A point is dominated if another one is at least as fast and at
 * least as accurate, and better in one of the two.
 * @param points {{ms: number, psnr: number}[]} milliseconds and dB.
 */
export function nonDominated(points) {
  const dominates = (a, b) => a.ms <= b.ms && a.psnr >= b.psnr && (a.ms < b.ms || a.psnr > b.psnr);
  return points.filter((point) => !points.some((other) => dominates(other, point))).sort((a, b) => a.ms - b.ms);
}

/** Resolution of a run, as a fraction of the time and in dB: two measurements of `default` differ by as much. */
const [SAME_TIME, SAME_DECIBELS] = [0.01, 0.05];

/**
 * Points that dominate one: they are as fast, as accurate and as small, and clearly better in one of the three. Sizes of other renderers are unknown and count as 0.
 * @param points {{ms: number, psnr: number, bytes?: number}[]} milliseconds, dB and bytes for each splat.
 */
export function passing(point, points) {
  const bytesOf = ({ bytes = 0 }) => bytes;
  const isNoWorse = ({ ms, psnr, bytes = 0 }) => ms <= point.ms && psnr >= point.psnr && bytes <= bytesOf(point);
  const isBetter = ({ ms, psnr, bytes = 0 }) =>
    ms < (1 - SAME_TIME) * point.ms || psnr > point.psnr + SAME_DECIBELS || bytes < bytesOf(point);
  return points.filter((other) => isNoWorse(other) && isBetter(other));
}

/**
 * Area that the points dominate below `reference.ms` and above `reference.psnr`, in decades of time times dB: one number
 * that grows when anything gets faster or more accurate.
 */
export function hypervolume(points, reference = { ms: 16.6, psnr: 36 }) {
  const front = nonDominated(points.filter(({ ms, psnr }) => ms < reference.ms && psnr > reference.psnr));
  return front.reduce((area, { ms, psnr }, i) => {
    const until = front[i + 1]?.ms ?? reference.ms;
    return area + Math.log10(until / ms) * (psnr - reference.psnr);
  }, 0);
}

/**
 * Milliseconds a frame: of many in a row, the queue drained once, the same clock for all. If a configuration was measured in turns with the default, its time is the ratio of the two times the default's time over the whole run: the clock of a GPU that changes within a run then changes nothing.
 */
export function timeOf(result, standard) {
  const { burst, ratio } = result;
  const common = standard?.burst;
  return ratio?.burst && common ? ratio.burst.p50 * common.p50 : burst.p50;
}

/** Bytes of GPU memory for each splat of the scene as it is, whether a configuration leaves some out or adds coarser ones. */
export function bytesASplat({ bytes }, { splats }) {
  return bytes && (bytes.scene + bytes.renderer) / splats;
}

/** SSIM, and LPIPS if it was measured, of the worst views. */
export const perceptual = ({ ssim, lpips }) =>
  `SSIM ${ssim.toFixed(4)}${lpips === undefined ? '' : `, LPIPS ${lpips.toFixed(4)}`}`;

/** The points of a report. */
export function pointsOf({ results, standard, scene }) {
  return results
    .filter((result) => !result.error)
    .map((result) => ({ ...result, ms: timeOf(result, standard), bytes: bytesASplat(result, scene) }))
    .map(({ configuration, quality, ms, bytes }) => ({
      name: configuration.name,
      tier: configuration.tier,
      peer: configuration.peer,
      ms,
      // An image without any error at all has no finite PSNR; no chart needs more.
      psnr: Math.min(120, quality.psnr),
      worst: quality.worst,
      ssim: quality.ssim,
      lpips: quality.lpips,
      bytes,
    }));
}
