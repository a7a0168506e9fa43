/** Cuts, by their definition: a splat changes by the share of it that lies in a shape, whose surface counts as its tangent plane. */
import { inverse, multiply, type GaussianCloud, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { SplatCut } from '@gaussian-splat/renderer/modifiers';
import { rotationTimesScale, worldPosition } from './projection.js';
import { thinnedBy } from './thinned.js';

const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Share of the standard normal distribution below x: its series, and far out the continued fraction of its tail. */
export function normalBelow(x: number): number {
  if (x < 0) return 1 - normalBelow(-x);
  const density = Math.exp(-0.5 * x * x) / Math.sqrt(2 * Math.PI);
  if (x > 6) return 1 - density / (x + 1 / (x + 2 / (x + 3 / (x + 4 / x))));
  let [term, sum] = [x, x];
  for (let k = 1; k < 200; k++) sum += term *= (x * x) / (2 * k + 1);
  return 0.5 + density * sum;
}

/** A coordinate of the shape at a splat's center, its gradient in the scene's frame, and the values between which the shape lies. */
interface Slab {
  readonly at: number;
  readonly gradient: number[];
  readonly low: number;
  readonly high: number;
}

function slabsOf(shape: SplatCut['shape'], [x, y, z]: number[], rows: number[][]): Slab[] {
  const between = (at: number, gradient: number[]): Slab => ({ at, gradient, low: -0.5, high: 0.5 });
  const radial = (...parts: [number, number[]][]): Slab => {
    const radius = Math.hypot(...parts.map(([at]) => at));
    const gradient = [0, 1, 2].map((k) => parts.reduce((sum, [at, row]) => sum + (at / radius) * row[k], 0));
    return between(radius, gradient);
  };
  switch (shape) {
    case 'plane':
      return [{ at: y, gradient: rows[1], low: -Infinity, high: 0 }];
    case 'box':
      return [between(x, rows[0]), between(y, rows[1]), between(z, rows[2])];
    case 'sphere':
      return [radial([x, rows[0]], [y, rows[1]], [z, rows[2]])];
    case 'cylinder':
      return [radial([x, rows[0]], [z, rows[2]]), between(y, rows[1])];
  }
}

/** Share of splat `i` that a cut changes. */
export function shareCut(cloud: GaussianCloud, i: number, cut: SplatCut, sceneToWorld: Matrix4 = IDENTITY): number {
  const { shape, shapeToWorld, side, edge = 0 } = cut;
  const toShape = multiply(inverse(shapeToWorld), sceneToWorld);
  const rows = [0, 1, 2].map((k) => [...toShape.slice(4 * k, 4 * k + 3)]);
  const position = worldPosition(cloud, i);
  const at = rows.map((row, k) => dot(row, position) + toShape[4 * k + 3]);
  const axes = rotationTimesScale(cloud, i);
  const worldSize = Math.cbrt(Math.abs(determinant(sceneToWorld)));
  const inside = slabsOf(shape, at, rows).reduce((share, slab) => {
    if (edge === 'hard') return slab.at >= slab.low && slab.at <= slab.high ? share : 0;
    const spread = [0, 1, 2].map((k) => dot(slab.gradient, [axes[0][k], axes[1][k], axes[2][k]]));
    const deviation = Math.hypot(...spread, (edge / worldSize) * Math.hypot(...slab.gradient));
    return share * (normalBelow((slab.high - slab.at) / deviation) - normalBelow((slab.low - slab.at) / deviation));
  }, 1);
  return side === 'outside' ? 1 - inside : inside;
}

/** A cloud as cuts leave it, and the colors of its splats. */
export function cutCloud(
  cloud: GaussianCloud,
  cuts: readonly SplatCut[],
  sceneToWorld: Matrix4 = IDENTITY,
): { cloud: GaussianCloud; recolor: (i: number, color: Vector3) => Vector3 } {
  const shares = Array.from({ length: cloud.count }, (_, i) =>
    cuts.map((cut) => shareCut(cloud, i, cut, sceneToWorld)),
  );
  const toScene = inverse(sceneToWorld);
  const opacities = cloud.opacities.map((own, i) =>
    cuts.reduce((left, { opacity = 1, surfaceOpacity = 1 }, k) => {
      const share = shares[i][k];
      const factor = Math.min(1, Math.log(1 - surfaceOpacity) / Math.log(1e-4));
      return thinnedBy(left * (1 + share * (opacity - 1)), 1 + share * (factor - 1));
    }, own),
  );
  const positions = cloud.positions.map((own, j) => {
    const [i, axis] = [Math.floor(j / 3), j % 3];
    return cuts.reduce((sum, { offset = [0, 0, 0] }, k) => {
      const moved = [0, 1, 2].reduce((total, m) => total + toScene[4 * axis + m] * offset[m], 0);
      return sum + shares[i][k] * moved;
    }, own);
  });
  const recolor = (i: number, color: Vector3): Vector3 => {
    const mapped = cuts.reduce<Vector3>((from, { color: map }, k) => {
      if (map === undefined) return from;
      const to = [0, 1, 2].map((row) => dot(map.slice(4 * row, 4 * row + 3), from) + map[4 * row + 3]);
      return from.map((channel, c) => channel + shares[i][k] * (to[c] - channel)) as unknown as Vector3;
    }, color);
    return mapped.map((channel) => Math.max(0, channel)) as unknown as Vector3;
  };
  return { cloud: { ...cloud, opacities, positions }, recolor };
}

const dot = (a: readonly number[], b: readonly number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const determinant = (m: Matrix4): number =>
  m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
