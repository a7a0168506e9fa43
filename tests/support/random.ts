/** Repeatable random numbers: the same seed gives the same scene on every machine. */
import type { Vector3 } from '@gaussian-splat/core';

export interface Random {
  /** Uniform in low..high. */
  uniform(low: number, high: number): number;
  /** Uniform on a logarithmic scale in low..high, both above 0. */
  logUniform(low: number, high: number): number;
  /** Normal with mean 0 and standard deviation 1. */
  normal(): number;
  /** Uniform on the unit sphere. */
  direction(): Vector3;
  /** Unit quaternion (w, x, y, z), uniform over all rotations. */
  rotation(): Quaternion;
}

export type Quaternion = readonly [w: number, x: number, y: number, z: number];

export function seededRandom(seed: number): Random {
  const next = mulberry32(seed);
  // Box and Muller; 1 - u keeps the logarithm finite.
  const normal = (): number => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
  const onSphere = (dimensions: number): number[] => {
    const v = Array.from({ length: dimensions }, normal);
    const norm = Math.hypot(...v);
    return v.map((x) => x / norm);
  };
  return {
    uniform: (low, high) => low + (high - low) * next(),
    logUniform: (low, high) => low * (high / low) ** next(),
    normal,
    direction: () => onSphere(3) as unknown as Vector3,
    rotation: () => onSphere(4) as unknown as Quaternion,
  };
}

/** Tommy Ettinger's mulberry32: 32 bits of state, numbers in 0..1 (1 excluded). */
function mulberry32(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}
