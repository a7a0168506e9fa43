/**
 * Cuts, by their definition: a splat changes by its fraction within a shape, whose surface counts as its tangent plane. The rest of a partly hidden splat is a Gaussian again.
 */
import { inverse, multiply, type GaussianCloud, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { SplatCut } from '@gaussian-splat/renderer/modifiers';
import { rotationTimesScale, worldPosition, type ShearedCloud } from './projection.js';
import { thinnedBy } from './thinned.js';

const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Fraction of the standard normal distribution below x: its series, and far out the continued fraction of its tail. */
export function normalBelow(x: number): number {
  if (x < 0) return 1 - normalBelow(-x);
  const density = Math.exp(-0.5 * x * x) / Math.sqrt(2 * Math.PI);
  if (x > 6) return 1 - density / (x + 1 / (x + 2 / (x + 3 / (x + 4 / x))));
  let [term, sum] = [x, x];
  for (let k = 1; k < 200; k++) sum += term *= (x * x) / (2 * k + 1);
  return 0.5 + density * sum;
}

/** A coordinate of the shape at a splat's center, its gradient in the scene's frame, and the shape's bounds. */
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
    case 'everywhere':
      return [];
  }
}

/** A cloud whose splats belong to groups, which cuts name. */
export interface GroupedCloud extends GaussianCloud {
  readonly groups?: ArrayLike<number>;
}

/** Density of the standard normal distribution, and its product with x: 0 far out. */
const density = (x: number): number => Math.exp(-0.5 * x * x) / Math.sqrt(2 * Math.PI);
const weighted = (x: number): number => (Number.isFinite(x) ? x * density(x) : 0);

/** The part of a splat between the limits of one coordinate of a shape, softened by the edge. */
interface Limits {
  readonly share: number;
  /** Root of the covariance, transposed, times the gradient. */
  readonly spread: number[];
  /** Limits in standard deviations of both, and the fraction of these that is the splat's own. */
  readonly low: number;
  readonly high: number;
  readonly own: number;
}

/** Limits of splat `i` in each coordinate of a cut's shape. Splats of other groups are outside. */
function limitsOf(cloud: GroupedCloud, i: number, cut: SplatCut, sceneToWorld: Matrix4): Limits[] {
  const { shape, shapeToWorld, edge = 0, groups } = cut;
  if (groups && !groups.includes(cloud.groups![i])) return [{ share: 0, spread: [0, 0, 0], low: 0, high: 0, own: 0 }];
  const toShape = multiply(inverse(shapeToWorld), sceneToWorld);
  const rows = [0, 1, 2].map((k) => [...toShape.slice(4 * k, 4 * k + 3)]);
  const position = worldPosition(cloud, i);
  const at = rows.map((row, k) => dot(row, position) + toShape[4 * k + 3]);
  const axes = rotationTimesScale(cloud, i);
  const worldSize = Math.cbrt(Math.abs(determinant(sceneToWorld)));
  return slabsOf(shape, at, rows).map((slab) => {
    const spread = [0, 1, 2].map((k) => dot(slab.gradient, [axes[0][k], axes[1][k], axes[2][k]]));
    const wide = edge === 'hard' ? 0 : (edge / worldSize) * Math.hypot(...slab.gradient);
    const deviation = Math.hypot(...spread, wide);
    const [low, high] = [(slab.low - slab.at) / deviation, (slab.high - slab.at) / deviation];
    const own = Math.hypot(...spread) / deviation;
    if (edge !== 'hard') return { share: normalBelow(high) - normalBelow(low), spread, low, high, own };
    return { share: slab.at >= slab.low && slab.at <= slab.high ? 1 : 0, spread, low, high, own };
  });
}

/** Fraction of splat `i` that a cut changes. */
export function shareCut(cloud: GaussianCloud, i: number, cut: SplatCut, sceneToWorld: Matrix4 = IDENTITY): number {
  const inside = limitsOf(cloud, i, cut, sceneToWorld).reduce((product, { share }) => product * share, 1);
  return cut.side === 'outside' ? 1 - inside : inside;
}

/** A splat that cuts have trimmed. */
interface Trimmed {
  readonly opacity: number;
  readonly position: number[];
  readonly axes: number[][];
}

/** The least of a variance that trimming keeps, and the least mass that is seen. */
const [MIN_VARIANCE, MIN_MASS] = [0.01, 0.004];

/**
 * The rest of a splat after a cut that hides: the Gaussian whose mass, mean and variance along each coordinate of the shape are those of the splat times the opacity of the cut at each place, at which the other coordinates count by their means.
 */
function trim(splat: Trimmed, cloud: GaussianCloud, i: number, cut: SplatCut, sceneToWorld: Matrix4): Trimmed {
  const { opacity = 1, side, edge } = cut;
  const limits = limitsOf(cloud, i, cut, sceneToWorld);
  const inside = limits.reduce((product, { share }) => product * share, 1);
  const share = side === 'outside' ? 1 - inside : inside;
  const mass = 1 - (1 - opacity) * share;
  if (edge === 'hard' || share <= 0 || share >= 1 || mass >= 1 || mass <= MIN_MASS)
    return { ...splat, opacity: splat.opacity * mass };
  const [base, sign] = side === 'outside' ? [opacity, 1] : [1, -1];
  const found = rotationTimesScale(cloud, i);
  let { position, axes } = splat;
  let narrowed = 1;
  for (const each of limits) {
    const weight = sign * (1 - opacity) * Math.min(inside / each.share, 1);
    const mean = (weight * each.own * (density(each.low) - density(each.high))) / mass;
    const inner = each.share + each.own ** 2 * (weighted(each.low) - weighted(each.high));
    const kept = Math.min(1, Math.max(MIN_VARIANCE, (base + weight * inner) / mass - mean * mean));
    const size = Math.hypot(...each.spread);
    position = position.map((value, row) => value + (mean * dot(found[row], each.spread)) / size);
    // The gradient of the same coordinate, in the axes as they are by now: found · spread is the covariance times it.
    const way = solved(found, each.spread);
    const spread = [0, 1, 2].map((k) => dot(way, [axes[0][k], axes[1][k], axes[2][k]]));
    const u = spread.map((value) => value / Math.hypot(...spread));
    axes = axes.map((row) => {
      const along = (1 - Math.sqrt(kept)) * dot(row, u);
      return row.map((value, k) => value - along * u[k]);
    });
    narrowed *= Math.sqrt(kept);
  }
  return { opacity: splat.opacity * Math.min(1, mass / narrowed), position, axes };
}

/** The gradient g with `spread` = axesᵀ · g, by Cramer's rule. */
function solved(axes: number[][], spread: number[]): number[] {
  const rows = [0, 1, 2].map((k) => [axes[0][k], axes[1][k], axes[2][k]]);
  const det = (m: number[][]): number =>
    m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
    m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
    m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  return [0, 1, 2].map(
    (column) => det(rows.map((row, r) => row.map((value, c) => (c === column ? spread[r] : value)))) / det(rows),
  );
}

/** A cloud as cuts leave it, and the colors of its splats. */
export function cutCloud(
  cloud: GaussianCloud,
  cuts: readonly SplatCut[],
  sceneToWorld: Matrix4 = IDENTITY,
): { cloud: ShearedCloud; recolor: (i: number, color: Vector3) => Vector3 } {
  if (cuts.length === 0) return { cloud, recolor: (_, color) => color };
  const shares = Array.from({ length: cloud.count }, (_, i) =>
    cuts.map((cut) => shareCut(cloud, i, cut, sceneToWorld)),
  );
  const toScene = inverse(sceneToWorld);
  const trimmed = shares.map((own, i) =>
    cuts.reduce<Trimmed>(
      (from, cut, k) => {
        const { surfaceOpacity = 1, offset = [0, 0, 0] } = cut;
        const splat = trim(from, cloud, i, cut, sceneToWorld);
        const factor = Math.min(1, Math.log(1 - surfaceOpacity) / Math.log(1e-4));
        const moved = [0, 1, 2].map((row) => own[k] * dot([...toScene.slice(4 * row, 4 * row + 3)], offset));
        const position = splat.position.map((value, row) => value + moved[row]);
        return { ...splat, position, opacity: thinnedBy(splat.opacity, 1 + own[k] * (factor - 1)) };
      },
      {
        opacity: cloud.opacities[i],
        position: [...cloud.positions.subarray(3 * i, 3 * i + 3)],
        axes: rotationTimesScale(cloud, i),
      },
    ),
  );
  const opacities = Float32Array.from(trimmed, ({ opacity }) => opacity);
  const positions = Float32Array.from(trimmed.flatMap(({ position }) => position));
  const recolor = (i: number, color: Vector3): Vector3 => {
    const mapped = cuts.reduce<Vector3>((from, { color: map }, k) => {
      if (map === undefined) return from;
      const to = [0, 1, 2].map((row) => dot(map.slice(4 * row, 4 * row + 3), from) + map[4 * row + 3]);
      return from.map((channel, c) => channel + shares[i][k] * (to[c] - channel)) as unknown as Vector3;
    }, color);
    return mapped.map((channel) => Math.max(0, channel)) as unknown as Vector3;
  };
  return { cloud: { ...cloud, opacities, positions, axes: trimmed.map(({ axes }) => axes) }, recolor };
}

const dot = (a: readonly number[], b: readonly number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const determinant = (m: Matrix4): number =>
  m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
