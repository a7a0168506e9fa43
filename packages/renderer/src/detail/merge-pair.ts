import type { Block } from './block.js';
import { coverOfOpacity, opacityOfCover } from './cover.js';

/** How much more it counts to displace a splat whose colour differs by 1 in a channel. */
const COLOR_WEIGHT = 2;

/** Square of how far merging two splats displaces them, in world units²: apart, in shape, and more if their colours differ. */
export function displacement(b: Block, i: number, j: number): number {
  const dx = b.x[i] - b.x[j];
  const dy = b.y[i] - b.y[j];
  const dz = b.z[i] - b.z[j];
  const xx = b.xx[i] - b.xx[j];
  const yy = b.yy[i] - b.yy[j];
  const zz = b.zz[i] - b.zz[j];
  const xy = b.xy[i] - b.xy[j];
  const xz = b.xz[i] - b.xz[j];
  const yz = b.yz[i] - b.yz[j];
  const size = b.xx[i] + b.yy[i] + b.zz[i] + b.xx[j] + b.yy[j] + b.zz[j];
  // Σ1 − Σ2 over the size of both has the unit of an area again: 0 for equal shapes.
  const shape = size > 0 ? (xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz)) / size : 0;
  const red = b.red[i] - b.red[j];
  const green = b.green[i] - b.green[j];
  const blue = b.blue[i] - b.blue[j];
  const color = 1 + COLOR_WEIGHT * (red * red + green * green + blue * blue);
  return (dx * dx + dy * dy + dz * dz) * color + shape;
}

/** Ward's criterion (1963): what a merge adds to the squared displacement of all that is covered. */
export function mergeCost(b: Block, i: number, j: number): number {
  return ((b.mass[i] * b.mass[j]) / (b.mass[i] + b.mass[j])) * displacement(b, i, j);
}

/**
 * Makes splat i stand for both: the first two moments of the two, and their cover as the three axes see it. Seen from so far away that
 * their displacement is a pixel, which is where they are first drawn as one: small splats are wider there, by the dilation.
 */
export function mergePair(b: Block, i: number, j: number): void {
  const mass = b.mass[i] + b.mass[j];
  const p = b.mass[i] / mass;
  const q = b.mass[j] / mass;
  const spread = p * b.spread[i] + q * b.spread[j] + p * q * displacement(b, i, j);
  const low = b.dilation * spread;
  const cover = jointCover(b, i, j, low);
  b.spread[i] = spread;
  const dx = b.x[j] - b.x[i];
  const dy = b.y[j] - b.y[i];
  const dz = b.z[j] - b.z[i];
  b.xx[i] = p * b.xx[i] + q * b.xx[j] + p * q * dx * dx;
  b.xy[i] = p * b.xy[i] + q * b.xy[j] + p * q * dx * dy;
  b.xz[i] = p * b.xz[i] + q * b.xz[j] + p * q * dx * dz;
  b.yy[i] = p * b.yy[i] + q * b.yy[j] + p * q * dy * dy;
  b.yz[i] = p * b.yz[i] + q * b.yz[j] + p * q * dy * dz;
  b.zz[i] = p * b.zz[i] + q * b.zz[j] + p * q * dz * dz;
  b.x[i] += q * dx;
  b.y[i] += q * dy;
  b.z[i] += q * dz;
  b.red[i] = p * b.red[i] + q * b.red[j];
  b.green[i] = p * b.green[i] + q * b.green[j];
  b.blue[i] = p * b.blue[i] + q * b.blue[j];
  const area = b.area(i, low);
  b.opacity[i] = area > 0 ? opacityOfCover(cover / area) : Math.max(b.opacity[i], b.opacity[j]);
  b.mass[i] = mass;
}

/**
 * Area that two splats cover together, in units of 2π, summed over the views along the three axes, all variances larger by `low`: what each covers, less what both do,
 * ∫ G₁ G₂ = 2π √|Σ₁| √|Σ₂| / √|Σ₁ + Σ₂| · exp(−δᵀ (Σ₁ + Σ₂)⁻¹ δ / 2).
 */
function jointCover(b: Block, i: number, j: number, low: number): number {
  const dx = b.x[j] - b.x[i];
  const dy = b.y[j] - b.y[i];
  const dz = b.z[j] - b.z[i];
  const first = coverOfOpacity(b.opacity[i]);
  const second = coverOfOpacity(b.opacity[j]);
  return (
    jointCoverAlong(b.xx, b.xy, b.yy, dx, dy, first, second, i, j, low) +
    jointCoverAlong(b.xx, b.xz, b.zz, dx, dz, first, second, i, j, low) +
    jointCoverAlong(b.yy, b.yz, b.zz, dy, dz, first, second, i, j, low)
  );
}

function jointCoverAlong(
  uu: Float64Array,
  uv: Float64Array,
  vv: Float64Array,
  du: number,
  dv: number,
  first: number,
  second: number,
  i: number,
  j: number,
  low: number,
): number {
  const areaI = Math.sqrt(Math.max(0, (uu[i] + low) * (vv[i] + low) - uv[i] * uv[i]));
  const areaJ = Math.sqrt(Math.max(0, (uu[j] + low) * (vv[j] + low) - uv[j] * uv[j]));
  const [a, c, d] = [uu[i] + uu[j] + 2 * low, uv[i] + uv[j], vv[i] + vv[j] + 2 * low];
  const both = a * d - c * c;
  const alone = first * areaI + second * areaJ;
  if (!(both > 0)) return alone;
  const distance = (d * du * du - 2 * c * du * dv + a * dv * dv) / both;
  return alone - ((first * second * areaI * areaJ) / Math.sqrt(both)) * Math.exp(-0.5 * distance);
}
