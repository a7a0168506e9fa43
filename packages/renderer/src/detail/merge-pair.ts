import { BLOCK, type Block } from './block.js';
import { coverOfOpacity, opacityOfCover } from './cover.js';

/** How much more it counts to displace a splat whose colour differs by 1 in a channel. */
const COLOR_WEIGHT = 2;

/** Numbers of one splat in {@link traitsOf}, of which the last is spare. */
const TRAITS = 16;
const traits = new Float64Array(TRAITS * BLOCK);

/** What {@link displacement} looks at, splat by splat in one piece: it is asked for millions of pairs. Valid until the next call. */
export function traitsOf(b: Block): Float64Array {
  for (let k = 0, at = 0; k < b.count; k++, at += TRAITS) {
    traits[at] = b.x[k];
    traits[at + 1] = b.y[k];
    traits[at + 2] = b.z[k];
    traits[at + 3] = b.xx[k];
    traits[at + 4] = b.yy[k];
    traits[at + 5] = b.zz[k];
    traits[at + 6] = b.xy[k];
    traits[at + 7] = b.xz[k];
    traits[at + 8] = b.yz[k];
    traits[at + 9] = b.xx[k] + b.yy[k] + b.zz[k];
    traits[at + 10] = b.red[k];
    traits[at + 11] = b.green[k];
    traits[at + 12] = b.blue[k];
    traits[at + 13] = b.mass[k];
  }
  return traits;
}

/** Square of how far merging splats i and j displaces them, in world units²: apart, in shape, and more if their colours differ. */
function displacement(t: Float64Array, i: number, j: number): number {
  const [p, q] = [TRAITS * i, TRAITS * j];
  const dx = t[p] - t[q];
  const dy = t[p + 1] - t[q + 1];
  const dz = t[p + 2] - t[q + 2];
  const xx = t[p + 3] - t[q + 3];
  const yy = t[p + 4] - t[q + 4];
  const zz = t[p + 5] - t[q + 5];
  const xy = t[p + 6] - t[q + 6];
  const xz = t[p + 7] - t[q + 7];
  const yz = t[p + 8] - t[q + 8];
  const size = t[p + 9] + t[q + 9];
  // Σ1 − Σ2 over the size of both has the unit of an area again: 0 for equal shapes.
  const shape = size > 0 ? (xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz)) / size : 0;
  const red = t[p + 10] - t[q + 10];
  const green = t[p + 11] - t[q + 11];
  const blue = t[p + 12] - t[q + 12];
  const color = 1 + COLOR_WEIGHT * (red * red + green * green + blue * blue);
  return (dx * dx + dy * dy + dz * dz) * color + shape;
}

/** Ward's criterion (1963): what a merge of splats i and j adds to the squared displacement of all that is covered. */
export function mergeCost(t: Float64Array, i: number, j: number): number {
  const first = t[TRAITS * i + 13];
  const second = t[TRAITS * j + 13];
  return ((first * second) / (first + second)) * displacement(t, i, j);
}

/**
 * Makes splat i stand for both: the first two moments of the two, and their cover as the three axes see it. Seen from so far away that
 * their displacement is a pixel, which is where they are first drawn as one: small splats are wider there, by the dilation.
 */
export function mergePair(b: Block, t: Float64Array, i: number, j: number): void {
  const mass = b.mass[i] + b.mass[j];
  const p = b.mass[i] / mass;
  const q = b.mass[j] / mass;
  const spread = p * b.spread[i] + q * b.spread[j] + p * q * displacement(t, i, j);
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
