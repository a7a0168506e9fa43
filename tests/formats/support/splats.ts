/** Splats with known values, before any activation, and the columns that a trainer would write for them. */
import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { seededRandom } from '../../support/random.js';
import type { PlyColumn, PlyType } from './ply-writer.js';

/** Raw values as files hold them: logits, logarithms, spherical harmonics with the channels side by side. */
export interface RawSplats {
  readonly count: number;
  readonly degree: number;
  /** [N][3] */
  readonly positions: readonly (readonly number[])[];
  readonly logScales: readonly (readonly number[])[];
  /** [N][4] (w, x, y, z) of length 1. */
  readonly rotations: readonly (readonly number[])[];
  readonly logits: readonly number[];
  /** [N][(d + 1)²][3] */
  readonly sh: readonly (readonly (readonly number[])[])[];
}

const f32 = Math.fround;

/** Random splats whose values are float32 numbers. */
export function rawSplats(count: number, degree: number, seed = 1): RawSplats {
  const random = seededRandom(seed);
  const rows = <T>(make: () => T): T[] => Array.from({ length: count }, make);
  const uniform = (low: number, high: number) => f32(random.uniform(low, high));
  return {
    count,
    degree,
    positions: rows(() => [uniform(-8, 8), uniform(-8, 8), uniform(-8, 8)]),
    logScales: rows(() => [uniform(-7, 1), uniform(-7, 1), uniform(-7, 1)]),
    rotations: rows(() => random.rotation().map(f32)),
    logits: rows(() => uniform(-5, 8)),
    sh: rows(() =>
      Array.from({ length: (degree + 1) ** 2 }, () => [uniform(-0.9, 0.9), uniform(-0.9, 0.9), uniform(-0.9, 0.9)]),
    ),
  };
}

/** Columns of the element `vertex` as INRIA's `save_ply` names them. */
export function inriaColumns(splats: RawSplats, type: PlyType = 'float'): PlyColumn[] {
  const { positions, logScales, rotations, logits, sh, degree } = splats;
  const rest = (degree + 1) ** 2 - 1;
  const column = (name: string, values: readonly number[]): PlyColumn => ({ name, type, values });
  return [
    ...['x', 'y', 'z'].map((name, k) =>
      column(
        name,
        positions.map((p) => p[k]),
      ),
    ),
    ...[0, 1, 2].map((c) =>
      column(
        `f_dc_${c}`,
        sh.map((s) => s[0][c]),
      ),
    ),
    ...Array.from({ length: 3 * rest }, (_, i) =>
      column(
        `f_rest_${i}`,
        sh.map((s) => s[1 + (i % rest)][Math.floor(i / rest)]),
      ),
    ),
    column('opacity', logits),
    ...[0, 1, 2].map((k) =>
      column(
        `scale_${k}`,
        logScales.map((s) => s[k]),
      ),
    ),
    ...[0, 1, 2, 3].map((k) =>
      column(
        `rot_${k}`,
        rotations.map((q) => q[k]),
      ),
    ),
  ];
}

/** The cloud expected for these splats: activated values, computed in float64. */
export function activated(splats: RawSplats, keptDegree: ShDegree) {
  return {
    positions: splats.positions.flat(),
    scales: splats.logScales.flat().map(Math.exp),
    rotations: splats.rotations.flat(),
    opacities: splats.logits.map((logit) => 1 / (1 + Math.exp(-logit))),
    sh: splats.sh.flatMap((s) => s.slice(0, shCoefficientCount(keptDegree)).flat()),
  };
}
