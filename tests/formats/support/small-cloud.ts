import type { GaussianCloud, ShDegree } from '@gaussian-splat/core';
import { seededRandom } from '../../support/random.js';

/** A cloud of random, drawable splats: positions in ±2, scales 0.01 to 0.3, colors within 0..1. */
export function smallCloud(count: number, shDegree: ShDegree, seed = 1): GaussianCloud {
  const random = seededRandom(seed);
  const numbers = (length: number, from: number, to: number): Float32Array =>
    Float32Array.from({ length }, () => random.uniform(from, to));
  const rotations = numbers(4 * count, -1, 1);
  for (let i = 0; i < count; i++) {
    const q = rotations.subarray(4 * i, 4 * i + 4);
    const norm = Math.hypot(...q);
    q.forEach((value, k) => (q[k] = value / norm));
  }
  return {
    count,
    origin: [0, 0, 0],
    positions: numbers(3 * count, -2, 2),
    scales: numbers(3 * count, 0.01, 0.3),
    rotations,
    opacities: numbers(count, 0.05, 0.99),
    sh: numbers(3 * (shDegree + 1) ** 2 * count, -1, 1),
    shDegree,
    antialiased: false,
    droppedCount: 0,
  };
}
