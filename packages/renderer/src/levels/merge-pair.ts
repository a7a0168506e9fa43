import {
  areaOf,
  BLUE,
  GREEN,
  joinMoments,
  MASS,
  OPACITY,
  RED,
  SPREAD,
  TRACE,
  X,
  XX,
  XY,
  XZ,
  Y,
  YY,
  YZ,
  Z,
  ZZ,
} from './splat-rows.js';

/**
 * Returns the coverage of a splat relative to its own area 2π √|Σ|: its opacity, if that is at most 1. A merged splat
 * may have to cover more than its area. It then has an opacity above 1, which is clamped when it is drawn and gives a
 * flat top (∫ min(1, o e^(−r²/2)) = 2π (1 + ln o)).
 */
export const coverOfOpacity = (opacity: number): number => (opacity <= 1 ? opacity : 1 + Math.log(opacity));

/** Maximum coverage of a splat, whose opacity is then e. */
const MAX_COVER = 2;

/** Returns the opacity of a splat with this coverage of its area: the inverse of {@link coverOfOpacity}. */
export function opacityOfCover(cover: number): number {
  return cover <= 1 ? cover : Math.exp(Math.min(MAX_COVER, cover) - 1);
}

/** Weight of a color difference in the displacement: for a difference of 1 in one channel. */
const COLOR_WEIGHT = 2;

/**
 * Returns the squared displacement from merging the splats at p and q, in world units². It depends on their distance,
 * shapes and colors.
 */
function displacement(rows: Float64Array, p: number, q: number): number {
  const dx = rows[p + X] - rows[q + X];
  const dy = rows[p + Y] - rows[q + Y];
  const dz = rows[p + Z] - rows[q + Z];
  const xx = rows[p + XX] - rows[q + XX];
  const yy = rows[p + YY] - rows[q + YY];
  const zz = rows[p + ZZ] - rows[q + ZZ];
  const xy = rows[p + XY] - rows[q + XY];
  const xz = rows[p + XZ] - rows[q + XZ];
  const yz = rows[p + YZ] - rows[q + YZ];
  const size = rows[p + TRACE] + rows[q + TRACE];
  // The difference Σ1 − Σ2, squared and divided by the size of both, has the unit of an area: 0 for equal shapes.
  const shape = size > 0 ? (xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz)) / size : 0;
  const red = rows[p + RED] - rows[q + RED];
  const green = rows[p + GREEN] - rows[q + GREEN];
  const blue = rows[p + BLUE] - rows[q + BLUE];
  const color = 1 + COLOR_WEIGHT * (red * red + green * green + blue * blue);
  return (dx * dx + dy * dy + dz * dz) * color + shape;
}

/**
 * Returns the cost of merging the splats at p and q: the increase of the total squared displacement, weighted by mass
 * (Ward's criterion, 1963).
 */
export function mergeCost(rows: Float64Array, p: number, q: number): number {
  const first = rows[p + MASS];
  const second = rows[q + MASS];
  return ((first * second) / (first + second)) * displacement(rows, p, q);
}

/**
 * Merges the splat at j into the one at i, which keeps the first two moments of both, and their coverage along the
 * three axes. The coverage is computed for the distance at which their displacement is one pixel, because the merged
 * splat is first drawn there. At that distance the dilation makes small splats wider.
 * @param dilation Variance that the renderer adds to splats, in px².
 */
export function mergePair(rows: Float64Array, i: number, j: number, dilation: number): void {
  const mass = rows[i + MASS] + rows[j + MASS];
  const p = rows[i + MASS] / mass;
  const q = rows[j + MASS] / mass;
  const moved = displacement(rows, i, j);
  const spread = p * rows[i + SPREAD] + q * rows[j + SPREAD] + p * q * moved;
  const low = dilation * spread;
  const cover = jointCover(rows, i, j, low);
  const largest = Math.max(rows[i + OPACITY], rows[j + OPACITY]);
  rows[i + SPREAD] = spread;
  joinMoments(rows, i, j, p);
  rows[i + RED] = p * rows[i + RED] + q * rows[j + RED];
  rows[i + GREEN] = p * rows[i + GREEN] + q * rows[j + GREEN];
  rows[i + BLUE] = p * rows[i + BLUE] + q * rows[j + BLUE];
  const area = areaOf(rows, i, low);
  rows[i + OPACITY] = area > 0 ? opacityOfCover(cover / area) : largest;
  rows[i + MASS] = mass;
}

/**
 * Returns the area that two splats cover together in units of 2π, summed over views along the three axes, with all
 * variances increased by `low`. Each area is weighted by the {@link coverOfOpacity} of its splat. The weighted overlap is
 * subtracted: ∫ G₁ G₂ = 2π √|Σ₁| √|Σ₂| / √|Σ₁ + Σ₂| · exp(−δᵀ (Σ₁ + Σ₂)⁻¹ δ / 2).
 */
function jointCover(rows: Float64Array, i: number, j: number, low: number): number {
  const dx = rows[j + X] - rows[i + X];
  const dy = rows[j + Y] - rows[i + Y];
  const dz = rows[j + Z] - rows[i + Z];
  const first = coverOfOpacity(rows[i + OPACITY]);
  const second = coverOfOpacity(rows[j + OPACITY]);
  return (
    jointCoverAlong(rows, i, j, XX, XY, YY, dx, dy, first, second, low) +
    jointCoverAlong(rows, i, j, XX, XZ, ZZ, dx, dz, first, second, low) +
    jointCoverAlong(rows, i, j, YY, YZ, ZZ, dy, dz, first, second, low)
  );
}

function jointCoverAlong(
  rows: Float64Array,
  i: number,
  j: number,
  uu: number,
  uv: number,
  vv: number,
  du: number,
  dv: number,
  first: number,
  second: number,
  low: number,
): number {
  const ui = rows[i + uu] + low;
  const vi = rows[i + vv] + low;
  const uj = rows[j + uu] + low;
  const vj = rows[j + vv] + low;
  const areaI = Math.sqrt(Math.max(0, ui * vi - rows[i + uv] * rows[i + uv]));
  const areaJ = Math.sqrt(Math.max(0, uj * vj - rows[j + uv] * rows[j + uv]));
  const a = ui + uj;
  const c = rows[i + uv] + rows[j + uv];
  const d = vi + vj;
  const both = a * d - c * c;
  const alone = first * areaI + second * areaJ;
  if (!(both > 0)) return alone;
  const distance = (d * du * du - 2 * c * du * dv + a * dv * dv) / both;
  return alone - ((first * second * areaI * areaJ) / Math.sqrt(both)) * Math.exp(-0.5 * distance);
}
