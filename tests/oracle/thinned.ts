/** Opacity of a scene, by its definition: the optical depth of each splat, integrated over its Gaussian, is multiplied by a factor. */
/** Upper limit of a splat's coverage. */
const ALPHA_MAX = 0.999;

/** Integral of -ln(1 - a exp(-t)) over t > 0: the dilogarithm of `a`. */
export function dilogarithm(a: number): number {
  // Euler's reflection: the series converges fast on one side.
  if (a > 0.5) return Math.PI ** 2 / 6 - Math.log(a) * Math.log(1 - a) - dilogarithm(1 - a);
  let sum = 0;
  for (let k = 1; k < 60; k++) sum += a ** k / k ** 2;
  return sum;
}

/** Opacity of a splat of a scene whose opaque surfaces (transmittance 1e-4) are to have the given opacity. */
export function thinned(own: number, opacity: number): number {
  return thinnedBy(own, Math.min(1, Math.log(1 - opacity) / Math.log(1e-4)));
}

/** Opacity of a splat whose optical depth is multiplied by a factor. */
export function thinnedBy(own: number, factor: number): number {
  if (factor >= 1) return own;
  const wanted = factor * dilogarithm(Math.min(own, ALPHA_MAX));
  let [low, high] = [0, 1];
  for (let step = 0; step < 50; step++) {
    const middle = (low + high) / 2;
    if (dilogarithm(middle) < wanted) low = middle;
    else high = middle;
  }
  return low;
}
