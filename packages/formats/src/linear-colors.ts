/** Conversion of scenes whose colors are linear instead of sRGB. */
import { shCoefficientCount } from '@gaussian-splat/core';
import { SH_C0, type DraftCloud } from './cloud.js';
import { warn } from './faults.js';

/** Encodes a linear color value by the sRGB transfer function, extended to negative values as an odd function. */
function encoded(linear: number): number {
  const size = Math.abs(linear);
  const value = size <= 0.0031308 ? 12.92 * size : 1.055 * size ** (1 / 2.4) - 0.055;
  return linear < 0 ? -value : value;
}

/** Minimum deviation for the finite difference. With smaller ones, it is nearly the derivative of the curve. */
const MIN_DEVIATION = 1e-4;

/**
 * Converts the linear colors of a cloud to sRGB, in place, and adds a warning. The mean color of each splat is exact. Its
 * view-dependent coefficients are multiplied by the slope of the transfer function, over plus and minus their standard
 * deviation. Blending encoded colors approximates linear blending, as the warning states.
 * @param source Property of the file that declares linear colors, for the warning.
 */
export function encodeLinearColors(cloud: DraftCloud, source: string): void {
  const { count, sh, shDegree } = cloud;
  const stride = 3 * shCoefficientCount(shDegree);
  for (let i = 0; i < count; i++) {
    for (let channel = 0; channel < 3; channel++) {
      const at = stride * i + channel;
      const linear = 0.5 + SH_C0 * sh[at];
      let squares = 0;
      for (let k = 3; k < stride; k += 3) squares += sh[at + k] ** 2;
      sh[at] = (encoded(linear) - 0.5) / SH_C0;
      if (squares === 0) continue;
      // The basis is orthonormal, so the mean square over all directions is the sum of squares divided by 4π.
      const deviation = Math.max(MIN_DEVIATION, Math.sqrt(squares / (4 * Math.PI)));
      const slope = (encoded(linear + deviation) - encoded(linear - deviation)) / (2 * deviation);
      for (let k = 3; k < stride; k += 3) sh[at + k] *= slope;
    }
  }
  warn(
    cloud,
    `Colors are linear (${source}). They are encoded as sRGB before splats are blended, so that blended edges are slightly darker than with linear blending.`,
  );
}
