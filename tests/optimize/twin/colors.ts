import { eyeOf, shCoefficientCount, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import type { Projected } from '../../../packages/optimize/src/merge/project.js';
import { shBasis } from './color.js';

/** Colors of the splats on the screen, [count, 3]; negative ones are black, as in the renderer. */
export function colorsOf(cloud: GaussianCloud, { count, source }: Projected, camera: Camera): Float32Array {
  const { positions, origin, sh, shDegree } = cloud;
  const numbers = shCoefficientCount(shDegree);
  const basis = new Float64Array(16);
  const eye = eyeOf(camera.worldToCamera);
  const colors = new Float32Array(3 * count);
  for (let k = 0; k < count; k++) {
    const i = source[k];
    const x = positions[3 * i] + origin[0] - eye[0];
    const y = positions[3 * i + 1] + origin[1] - eye[1];
    const z = positions[3 * i + 2] + origin[2] - eye[2];
    const norm = 1 / Math.sqrt(x * x + y * y + z * z);
    shBasis(shDegree, x * norm, y * norm, z * norm, basis);
    for (let channel = 0; channel < 3; channel++) {
      let value = 0.5;
      for (let c = 0; c < numbers; c++) value += basis[c] * sh[3 * (numbers * i + c) + channel];
      colors[3 * k + channel] = Math.max(0, value);
    }
  }
  return colors;
}
