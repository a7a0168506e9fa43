/** Planes of splats as captures have them: their centers lie off the plane, and their opacities and sizes vary. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { cloudOf, repeat } from './clouds.js';
import { randomSource } from './gpu.js';

export interface RoughPlane {
  /** Standard deviation of the centers from the plane, meters. */
  readonly noise: number;
  readonly shape: 'flat' | 'ball';
  /** Angle to the image plane, about the x axis, radians. */
  readonly lean: number;
  /** Distance of the plane on the optical axis, meters. */
  readonly distance: number;
}

/** Returns a plane of 2.4 x 2.4 m, y down and z forward, that meets the z axis at a distance from the origin. */
export function roughPlane({ noise, shape, lean, distance }: RoughPlane): GaussianCloud {
  const random = randomSource(17);
  const normal = (): number => Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
  const [sin, cos] = [Math.sin(lean), Math.cos(lean)];
  return cloudOf(
    repeat(14_400, () => {
      const [u, v, off] = [2.4 * (random() - 0.5), 2.4 * (random() - 0.5), noise * normal()];
      const size = 0.012 * Math.exp(0.4 * normal());
      const turn = (lean + 0.15 * normal()) / 2;
      return {
        position: [u, v * cos - off * sin, distance + v * sin + off * cos] as const,
        scale: shape === 'ball' ? size : ([1.3 * size, 1.3 * size, 0.1 * size] as const),
        rotation: [Math.cos(turn), Math.sin(turn), 0.08 * normal(), 0] as const,
        opacity: 0.2 + 0.75 * random(),
        color: [0.5, 0.5, 0.5] as const,
      };
    }),
  );
}
