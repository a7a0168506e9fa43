/** Which pixels a splat is compared with. */
import type { Camera } from '@gaussian-splat/core';
import type { Ellipse } from './projection.js';
import type { Rules } from './rules.js';

/** Columns left..right-1 and rows top..bottom-1, within the image. */
export interface PixelRect {
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
}

const TILE = 16;

export function footprintOf(ellipse: Ellipse, opacity: number, camera: Camera, rules: Rules): PixelRect {
  return rules.footprint === 'tiles' ? tilesOf(ellipse, camera) : boxOf(ellipse, opacity, camera, rules);
}

/**
 * The box around all pixels that can pass the alpha test; it saves time and cuts nothing. opacity·exp(-d²/2) >= minAlpha
 * holds up to d = sqrt(2·ln(opacity / minAlpha)) standard deviations, and an ellipse of "radius" d reaches d·sqrt(Σxx)
 * in x. One pixel more on each side, for rounding.
 */
function boxOf(ellipse: Ellipse, opacity: number, camera: Camera, rules: Rules): PixelRect {
  const deviations = Math.sqrt(2 * Math.max(0, Math.log(opacity / rules.minAlpha)));
  const reachX = deviations * Math.sqrt(ellipse.covariance.xx) + 1;
  const reachY = deviations * Math.sqrt(ellipse.covariance.yy) + 1;
  return {
    left: clamp(Math.floor(ellipse.x - reachX), camera.width),
    right: clamp(Math.ceil(ellipse.x + reachX), camera.width),
    top: clamp(Math.floor(ellipse.y - reachY), camera.height),
    bottom: clamp(Math.ceil(ellipse.y + reachY), camera.height),
  };
}

/**
 * INRIA's cut: the tiles that a square around the 3-sigma circle touches. There, pixel centers are whole numbers, hence
 * the half pixel; tile bounds are found by integer division after adding a tile less one pixel.
 */
function tilesOf(ellipse: Ellipse, camera: Camera): PixelRect {
  const { xx, xy, yy } = ellipse.covariance;
  const middle = (xx + yy) / 2;
  const largestVariance = middle + Math.sqrt(Math.max(0.1, middle * middle - (xx * yy - xy * xy)));
  const radius = Math.ceil(3 * Math.sqrt(largestVariance));
  const [x, y] = [ellipse.x - 0.5, ellipse.y - 0.5];
  return {
    left: clamp(TILE * Math.trunc((x - radius) / TILE), camera.width),
    right: clamp(TILE * Math.trunc((x + radius + TILE - 1) / TILE), camera.width),
    top: clamp(TILE * Math.trunc((y - radius) / TILE), camera.height),
    bottom: clamp(TILE * Math.trunc((y + radius + TILE - 1) / TILE), camera.height),
  };
}

const clamp = (value: number, size: number): number => Math.min(size, Math.max(0, value));
