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

/**
 * Area that the points dominate below `reference.ms` and above `reference.psnr`, in decades of time times dB: one number
 * that grows when anything gets faster or truer.
 */
export function hypervolume(points, reference = { ms: 16.6, psnr: 36 }) {
  const front = nonDominated(points.filter(({ ms, psnr }) => ms < reference.ms && psnr > reference.psnr));
  return front.reduce((area, { ms, psnr }, i) => {
    const until = front[i + 1]?.ms ?? reference.ms;
    return area + Math.log10(until / ms) * (psnr - reference.psnr);
  }, 0);
}

/**
 * The points of a report. Time is the GPU's span where timestamps exist, else the wall time with the queue drained, for
 * renderers that sort on the side until the image has its own order.
 */
export function pointsOf({ results }) {
  return results
    .filter((result) => !result.error)
    .map(({ configuration, quality, span, wall, sortedWall }) => ({
      name: configuration.name,
      tier: configuration.tier,
      peer: configuration.peer,
      clock: span ? 'GPU' : 'wall',
      ms: (span ?? sortedWall ?? wall).p50,
      // An image without any error at all has no finite PSNR; no chart needs more.
      psnr: Math.min(120, quality.psnr),
      worst: quality.worst,
      ssim: quality.ssim,
    }));
}
