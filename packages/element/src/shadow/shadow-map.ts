/** A contact shadow from images of the subject above the ground: taken from above, within four heights. Pure. */
import { lookAt, type Camera, type Vector3 } from '@gaussian-splat/core';
import { toScene, type ViewerFrame } from '../camera/orbit.js';
import type { SplatRow } from './splat-file.js';

/** Pixels of a side of the images. */
export const SHADOW_PIXELS = 128;
/** Splats of a side of the shadow; the standard deviation of each, in distances between them. */
const [CELLS, SPREAD] = [48, 0.75];
/** Half of the shadow's side relative to the radius of the subject's sphere: a soft edge extends beyond its caster. */
const REACH = 1.5;
/** How far the camera stands away, in radii: its rays are as good as parallel. */
const DISTANCE = 40;
/**
 * Layers of the shadow: height as a fraction of the subject's, weight of its darkness, and blur radius as a fraction of
 * the side at `shadow-softness="1"`. Parts that touch the ground darken it most and have the sharpest edge.
 */
const LAYERS = [
  { height: 0.08, weight: 0.25, blur: 0.012 },
  { height: 0.25, weight: 0.25, blur: 0.03 },
  { height: 0.55, weight: 0.25, blur: 0.05 },
  { height: 1, weight: 0.25, blur: 0.08 },
] as const;
/** Opacity of the darkest shadow. */
const DARKEST = 0.8;
/** Fraction of the subject's silhouette that may lie below the ground. */
const BELOW = 0.005;
/** Minimum opacity of a visible splat, 0..255. */
const MIN_CODE = 1;

/** The caster of the shadow: a sphere in viewer space, and the height of its ground. */
export interface Subject {
  readonly center: Vector3;
  readonly radius: number;
  readonly frame: ViewerFrame;
}

/** Opacity of an image of {@link SHADOW_PIXELS} a side, row by row from the top, 0..1. */
export type Alpha = ArrayLike<number>;

/** Takes such an image. */
export type TakeAlpha = (camera: Camera) => Promise<Alpha> | Alpha;

/** A shadow on the ground before it is blurred. */
export interface ShadowMap {
  /** Middle of the shadow, viewer space. */
  readonly middle: Vector3;
  /** Half of a side, units of viewer space. */
  readonly half: number;
  /** By layer. */
  readonly layers: readonly Alpha[];
}

/** Captures the images of a subject's shadow. @returns null without a caster */
export async function takeShadow(subject: Subject, take: TakeAlpha): Promise<ShadowMap | null> {
  const { center, radius } = subject;
  const side = extent(await take(sideCamera(subject)));
  if (side === null) return null;
  const at = (share: number): number => center[1] + radius * (1 - 2 * share);
  const [top, ground] = [at(side.first), at(side.last)];
  const half = REACH * radius;
  const layers: Alpha[] = [];
  for (const { height } of LAYERS) layers.push(await take(cameraAbove(subject, ground, height * (top - ground))));
  return { middle: [center[0], ground, center[2]], half, layers };
}

/** Camera in front of the subject, framing its sphere. */
const sideCamera = ({ center: [x, y, z], radius, frame }: Subject): Camera => {
  const away = DISTANCE * radius;
  const focal = (SHADOW_PIXELS * away) / (2 * radius);
  return camera(frame, [x, y, z + away], [x, y, z], [0, 1, 0], focal, away - radius, away + radius);
};

/** Camera above the subject, framing the shadow: parts above the height are clipped. */
const cameraAbove = ({ center: [x, , z], radius, frame }: Subject, ground: number, height: number): Camera => {
  const away = DISTANCE * radius;
  const focal = (SHADOW_PIXELS * away) / (2 * REACH * radius);
  const near = away - Math.max(height, 1e-3 * radius);
  return camera(frame, [x, ground + away, z], [x, ground, z], [0, 0, -1], focal, near, away + 0.02 * radius);
};

function camera(
  frame: ViewerFrame,
  eye: Vector3,
  target: Vector3,
  up: Vector3,
  focal: number,
  near: number,
  far: number,
): Camera {
  const [from, to, above] = [eye, target, up].map((v) => toScene(frame, v));
  const size = { width: SHADOW_PIXELS, height: SHADOW_PIXELS, cx: SHADOW_PIXELS / 2, cy: SHADOW_PIXELS / 2 };
  return { ...size, fx: focal, fy: focal, worldToCamera: lookAt(from, to, above), near, far };
}

/** First and last row of a silhouette as fractions of the image's height, without specks. */
function extent(alpha: Alpha): { first: number; last: number } | null {
  const rows = Array.from({ length: SHADOW_PIXELS }, (_, row) => {
    let sum = 0;
    for (let i = 0; i < SHADOW_PIXELS; i++) sum += alpha[row * SHADOW_PIXELS + i];
    return sum;
  });
  const all = rows.reduce((sum, row) => sum + row, 0);
  if (!(all > 1)) return null;
  let [above, first, last] = [0, 0, 1];
  rows.forEach((row, i) => {
    if (above < BELOW * all) first = i / SHADOW_PIXELS;
    if (above < (1 - BELOW) * all) last = (i + 1) / SHADOW_PIXELS;
    above += row;
  });
  return { first, last };
}

/**
 * The shadow as flat splats in a square of 2 x 2 around the origin, at y = 0.
 * @param intensity 0..1
 * @param softness 0..1
 */
export function shadowSplats({ layers }: ShadowMap, intensity: number, softness: number): SplatRow[] {
  const dark = new Float32Array(SHADOW_PIXELS * SHADOW_PIXELS);
  layers.forEach((alpha, k) => {
    const { weight, blur } = LAYERS[k];
    const blurred = blurredBy(alpha, softness * blur * SHADOW_PIXELS);
    for (let i = 0; i < dark.length; i++) dark[i] += weight * blurred[i];
  });
  const step = 2 / CELLS;
  const sigma = SPREAD * step;
  // Sum of all splat weights at each point.
  const overlap = 2 * Math.PI * SPREAD * SPREAD;
  const rows: SplatRow[] = [];
  for (let row = 0; row < CELLS; row++)
    for (let column = 0; column < CELLS; column++) {
      const opacity = Math.min(0.99, DARKEST * intensity * meanOf(dark, column, row));
      // Optical depths are additive; opacities are not.
      const own = 1 - Math.exp(Math.log(1 - opacity) / overlap);
      const code = Math.round(255 * own);
      if (code < MIN_CODE) continue;
      const place: Vector3 = [(column + 0.5) * step - 1, 0, (row + 0.5) * step - 1];
      rows.push([place, [sigma, 1e-4 * sigma, sigma], [0, 0, 0, code]]);
    }
  return rows;
}

/** Mean of the pixels of a cell. */
function meanOf(image: Float32Array, column: number, row: number): number {
  const range = (cell: number): [number, number] => {
    const from = Math.floor((cell * SHADOW_PIXELS) / CELLS);
    return [from, Math.max(from + 1, Math.floor(((cell + 1) * SHADOW_PIXELS) / CELLS))];
  };
  const [[left, right], [top, bottom]] = [range(column), range(row)];
  let sum = 0;
  for (let y = top; y < bottom; y++) for (let x = left; x < right; x++) sum += image[y * SHADOW_PIXELS + x];
  return sum / ((right - left) * (bottom - top));
}

/** Blurred along rows, then along columns, by a Gaussian of a standard deviation in pixels; nothing lies beyond the edges. */
function blurredBy(alpha: Alpha, sigma: number): Float32Array {
  const image = Float32Array.from(alpha);
  if (sigma < 0.3) return image;
  const reach = Math.ceil(3 * sigma);
  const kernel = Array.from({ length: 2 * reach + 1 }, (_, i) => Math.exp(-(((i - reach) / sigma) ** 2) / 2));
  const sum = kernel.reduce((total, value) => total + value, 0);
  const pass = (from: Float32Array, step: number, line: number): Float32Array => {
    const to = new Float32Array(from.length);
    for (let l = 0; l < SHADOW_PIXELS; l++)
      for (let at = 0; at < SHADOW_PIXELS; at++) {
        let value = 0;
        for (let k = Math.max(0, reach - at); k < kernel.length && at + k - reach < SHADOW_PIXELS; k++)
          value += kernel[k] * from[l * line + (at + k - reach) * step];
        to[l * line + at * step] = value / sum;
      }
    return to;
  };
  return pass(pass(image, 1, SHADOW_PIXELS), SHADOW_PIXELS, 1);
}
