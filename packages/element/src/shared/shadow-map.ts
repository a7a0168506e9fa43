/**
 * Computes a contact shadow from images of the subject above the ground, which are taken from above with four height
 * limits. Independent of the GPU.
 */
import { numberGrammar, readAttribute } from '../viewer/camera/grammar.js';
import type { Viewer } from '../viewer/viewer.js';
import { lookAt, type Camera, type Vector3 } from '@gaussian-splat/core';
import { toScene, type ViewerFrame } from '../viewer/camera/orbit.js';
import type { SplatRow } from './splat-file.js';

/** Width and height of the images, pixels. */
export const SHADOW_PIXELS = 128;
/** Number of splats along a side of the shadow, and standard deviation of a splat in units of their spacing. */
const [CELLS, SPREAD] = [48, 0.75];
/** Half of the shadow's side in radii of the subject: a soft edge extends beyond the subject. */
const REACH = 1.5;
/** Distance of the camera in radii of the subject. Its rays are nearly parallel. */
const DISTANCE = 40;
/**
 * Layers of the shadow. `height` is a fraction of the subject's height, `weight` a fraction of the darkness, and `blur`
 * the standard deviation at `shadow-softness="1"` as a fraction of the image's side. Parts that touch the ground cast
 * the darkest and sharpest shadow.
 */
const LAYERS = [
  { height: 0.08, weight: 0.25, blur: 0.012 },
  { height: 0.25, weight: 0.25, blur: 0.03 },
  { height: 0.55, weight: 0.25, blur: 0.05 },
  { height: 1, weight: 0.25, blur: 0.08 },
] as const;
/** Opacity of the darkest shadow. */
const DARKEST = 0.8;
/** Fraction of the subject's silhouette that may lie outside of its extent on each side, such as below the ground. */
const BELOW = 0.005;
/** Maximum ratio of the silhouette's radius to that of the images for which they are taken again, of it alone. */
const SMALL = 0.7;
/** Maximum number of times that they are taken again. */
const MAX_ZOOMS = 3;
/** Minimum opacity of a visible splat, 0..255. */
const MIN_CODE = 1;

/** The caster of the shadow: a sphere in viewer space, and the rotation from scene coordinates to viewer space. */
export interface Subject {
  readonly center: Vector3;
  readonly radius: number;
  readonly frame: ViewerFrame;
}

/** Opacity of an image of {@link SHADOW_PIXELS} a side, row by row from the top, 0..1. */
export type Alpha = ArrayLike<number>;

/** Captures the opacity of the subject from a camera. */
export type TakeAlpha = (camera: Camera) => Promise<Alpha> | Alpha;

/** Images of a shadow on the ground, before blurring. */
export interface ShadowMap {
  /** Center of the shadow in viewer space. */
  readonly middle: Vector3;
  /** Half of the side of the shadow, in units of viewer space. */
  readonly half: number;
  /** Opacity of each layer, seen from above. */
  readonly layers: readonly Alpha[];
}

/** Captures the images of a subject's shadow. @returns null if the subject has no visible splats */
export async function takeShadow(subject: Subject, take: TakeAlpha): Promise<ShadowMap | null> {
  const found = await silhouetteOf(subject, take);
  if (found === null) return null;
  const { center, radius, ground, top } = found;
  const half = REACH * radius;
  const layers: Alpha[] = [];
  for (const { height } of LAYERS) layers.push(await take(cameraAbove(found, ground, height * (top - ground))));
  return { middle: [center[0], ground, center[2]], half, layers };
}

/**
 * Returns the heights of a subject's silhouette, and the sphere that its images frame. What cuts leave of a scene is
 * often much smaller than the scene, so the sphere shrinks to what is visible.
 */
async function silhouetteOf(
  subject: Subject,
  take: TakeAlpha,
): Promise<(Subject & { readonly ground: number; readonly top: number }) | null> {
  for (let zooms = 0; ; zooms++) {
    const { center, radius, frame } = subject;
    const front = await take(sideCamera(subject));
    const [x, y] = [extent(front, 1, SHADOW_PIXELS), extent(front, SHADOW_PIXELS, 1)];
    if (x === null || y === null) return null;
    const found = {
      ...subject,
      ground: center[1] + radius * (1 - 2 * y.last),
      top: center[1] + radius * (1 - 2 * y.first),
    };
    if (zooms === MAX_ZOOMS || Math.max(x.last - x.first, y.last - y.first) > SMALL) return found;
    const plan = await take(cameraAbove(subject, center[1] - radius, 2 * radius));
    const z = extent(plan, SHADOW_PIXELS, 1);
    if (z === null) return found;
    const ends = [x, { first: 1 - y.last, last: 1 - y.first }].map(({ first, last }) => [2 * first - 1, 2 * last - 1]);
    ends.push([REACH * (2 * z.first - 1), REACH * (2 * z.last - 1)]);
    const small = (radius * Math.hypot(...ends.map(([from, to]) => to - from))) / 2;
    if (small > SMALL * radius) return found;
    const middle = center.map((value, k) => value + (radius * (ends[k][0] + ends[k][1])) / 2);
    subject = { center: middle as unknown as Vector3, radius: small, frame };
  }
}

/** Returns the camera in front of the subject that frames its sphere. */
const sideCamera = ({ center: [x, y, z], radius, frame }: Subject): Camera => {
  const away = DISTANCE * radius;
  const focal = (SHADOW_PIXELS * away) / (2 * radius);
  return camera(frame, [x, y, z + away], [x, y, z], [0, 1, 0], focal, away - radius, away + radius);
};

/**
 * Returns the camera above the subject that frames the shadow. Its near plane clips parts above a height over the
 * ground.
 */
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

/**
 * Returns the first and last row, or column, of a silhouette as fractions of the image's side, ignoring small specks;
 * null for an empty image.
 * @param line Distance between rows or columns in the image, 1 or {@link SHADOW_PIXELS}
 * @param step Distance between the pixels of one of them
 */
function extent(alpha: Alpha, line: number, step: number): { first: number; last: number } | null {
  const rows = Array.from({ length: SHADOW_PIXELS }, (_, row) => {
    let sum = 0;
    // The square ignores haze and the faint rims of splats.
    for (let i = 0; i < SHADOW_PIXELS; i++) sum += alpha[row * line + i * step] ** 2;
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
 * Returns the shadow as flat splats in a square of 2 x 2 units around the origin, at y = 0.
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
  // Sum of the weights of all overlapping splats at each point.
  const overlap = 2 * Math.PI * SPREAD * SPREAD;
  const rows: SplatRow[] = [];
  for (let row = 0; row < CELLS; row++)
    for (let column = 0; column < CELLS; column++) {
      const opacity = Math.min(0.99, DARKEST * intensity * meanOf(dark, column, row));
      // Divides the optical depth by the overlap, because optical depths are additive and opacities are not.
      const own = 1 - Math.exp(Math.log(1 - opacity) / overlap);
      const code = Math.round(255 * own);
      if (code < MIN_CODE) continue;
      const place: Vector3 = [(column + 0.5) * step - 1, 0, (row + 0.5) * step - 1];
      rows.push([place, [sigma, 1e-4 * sigma, sigma], [0, 0, 0, code]]);
    }
  return rows;
}

/** Returns the mean of an image's pixels in a cell. */
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

/**
 * Returns an image blurred by a Gaussian, along rows and then along columns. Pixels outside the image are 0.
 * @param sigma Standard deviation in pixels; no blur below 0.3.
 */
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

/** Parses `shadow-intensity` and `shadow-softness`, 0..1 each. */
export function readShadow({ attributes, warn }: Viewer): {
  readonly intensity: number;
  readonly softness: number;
} {
  const of = (name: string, value: number | string | null, fallback: number): number =>
    readAttribute(name, value, numberGrammar(fallback, 0, 'a number from 0 to 1', 1), warn);
  const { shadowIntensity, shadowSoftness } = attributes;
  return {
    intensity: of('shadow-intensity', shadowIntensity, 0),
    softness: of('shadow-softness', shadowSoftness, 1),
  };
}
