/** A ball of splats that turns about its vertical axis. */
import type { GaussianCloud, ShDegree } from '@gaussian-splat/core';
import { HarmonicsTurner } from '@gaussian-splat/formats';
import { cloudOf } from '../clouds.js';
import { seededRandom } from '../random.js';

export interface TurningBall {
  readonly frame: number;
  readonly degree?: ShDegree;
  readonly splats?: number;
  /** Degrees between two frames. */
  readonly degrees?: number;
  /** Whether the harmonics turn with the splats. */
  readonly turns?: boolean;
}

export function turningBall({ frame, degree = 3, splats = 60, degrees = 7, turns = true }: TurningBall): GaussianCloud {
  const random = seededRandom(2);
  const angle = (degrees * frame * Math.PI) / 180;
  const [w, y] = [Math.cos(angle / 2), Math.sin(angle / 2)];
  const cloud = cloudOf(
    Array.from({ length: splats }, () => {
      const [x, up, z] = random.direction();
      const [a, b, c, d] = random.rotation();
      return {
        position: [Math.cos(angle) * x + Math.sin(angle) * z, up, Math.cos(angle) * z - Math.sin(angle) * x] as const,
        rotation: [w * a - y * c, w * b + y * d, w * c + y * a, w * d - y * b] as const,
        ...{ scale: [0.2, 0.1, 0.05] as const, opacity: 0.9 },
        color: [random.uniform(0, 1), 0.5, 0.5] as const,
        sh: Array.from({ length: 45 }, () => random.uniform(-0.2, 0.2)),
      };
    }),
    degree,
  );
  const turner = new HarmonicsTurner(degree);
  if (turns) for (let i = 0; i < cloud.count; i++) turner.turn(cloud.sh, i, [w, 0, y, 0]);
  return cloud;
}
