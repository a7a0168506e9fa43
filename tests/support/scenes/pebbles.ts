/** Scenes of many splats on surfaces, which suit levels of detail, since neighbors can replace one another. */
import { add, scale, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { cloudOf, type SplatDescription } from '../clouds.js';
import { seededRandom, type Random } from '../random.js';

/** Stones of about 3,000 splats each, scattered over 12 x 12 world units; their colors change slowly over the surface. */
export function pebbles(count: number, seed = 7): GaussianCloud {
  const random = seededRandom(seed);
  const stones = Array.from({ length: Math.ceil(count / 3000) }, () => ({
    center: [random.uniform(-6, 6), random.uniform(-0.3, 0.3), random.uniform(-6, 6)] as Vector3,
    radius: random.uniform(0.3, 0.9),
    hue: random.uniform(0, 6),
  }));
  return cloudOf(
    Array.from({ length: count }, (_, i) => pebbleSplat(random, stones[i % stones.length])),
    1,
  );
}

interface Stone {
  readonly center: Vector3;
  readonly radius: number;
  readonly hue: number;
}

function pebbleSplat(random: Random, { center, radius, hue }: Stone): SplatDescription {
  const direction = random.direction();
  const bump = 1 + 0.05 * Math.sin(9 * direction[0]) * Math.cos(7 * direction[2]);
  const size = radius * random.logUniform(0.01, 0.05);
  const wave = 0.15 * Math.sin(4 * direction[0] + 3 * direction[1] + hue);
  return {
    position: add(center, scale(direction, radius * bump)),
    scale: [size, size * random.uniform(0.3, 1), size * random.uniform(0.05, 0.5)],
    rotation: random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [0.5 + wave + 0.2 * Math.sin(hue), 0.45 + wave, 0.4 - wave + 0.2 * Math.cos(hue)],
    sh: Array.from({ length: 9 }, (_, k) => 0.08 * Math.sin(2 * direction[k % 3] + hue + k)),
  };
}
