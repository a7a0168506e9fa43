// The exponential function of two numbers.

// prettier-ignore
export const LOG_LOW: f64 = 1.90821492927058770002e-10, LOG_HIGH: f64 = 6.93147180369123816490e-1;

/**
 * exp of two float32 numbers, within 1e-15: equal to Math.exp after rounding to float32. Beyond the range of float32 the
 * result is infinite or 0; NaN stays.
 */
@inline
export function exp2(given: v128): v128 {
  const x = f64x2.pmin(f64x2.splat(200), f64x2.pmax(f64x2.splat(-200), given));
  const k = f64x2.nearest(f64x2.mul(x, f64x2.splat(1.44269504088896338700)));
  const r = f64x2.sub(
    f64x2.sub(x, f64x2.mul(k, f64x2.splat(LOG_HIGH))),
    f64x2.mul(k, f64x2.splat(LOG_LOW)),
  );
  const r2 = f64x2.mul(r, r);
  const r4 = f64x2.mul(r2, r2);
  const a = f64x2.add(f64x2.splat(1), r);
  const b = f64x2.add(f64x2.splat(0.5), f64x2.mul(r, f64x2.splat(1.0 / 6)));
  const c = f64x2.add(f64x2.splat(1.0 / 24), f64x2.mul(r, f64x2.splat(1.0 / 120)));
  const d = f64x2.add(f64x2.splat(1.0 / 720), f64x2.mul(r, f64x2.splat(1.0 / 5040)));
  const e = f64x2.add(f64x2.splat(1.0 / 40320), f64x2.mul(r, f64x2.splat(1.0 / 362880)));
  const f = f64x2.add(f64x2.splat(1.0 / 3628800), f64x2.mul(r, f64x2.splat(1.0 / 39916800)));
  const ab = f64x2.add(a, f64x2.mul(r2, b));
  const cd = f64x2.add(c, f64x2.mul(r2, d));
  const ef = f64x2.add(e, f64x2.mul(r2, f));
  const sum = f64x2.add(ab, f64x2.mul(r4, f64x2.add(cd, f64x2.mul(r4, ef))));
  // Adds k to the exponent: the low bits of k + 1.5 2^52 are k.
  const power = i64x2.shl(f64x2.add(k, f64x2.splat(6755399441055744.0)), 52);
  return i64x2.add(sum, power);
}
