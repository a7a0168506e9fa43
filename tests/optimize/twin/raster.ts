import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import type { Image } from '@gaussian-splat/optimize';
import { ALPHA_MIN, factors, project, type Projected } from '../../../packages/optimize/src/merge/project.js';
import { colorsOf } from './colors.js';
import type { Painter } from './painter.js';
import type { ContributionScorer, Contributions } from './scorer.js';

const ALPHA_MAX = 0.99;
/** Absorbed light behind which nothing more is visible. */
const OPAQUE = 1e-4;
/** Counts are below this: a depth's 32 bits and a number fit the 53 bits of a float64. */
const MAX_COUNT = 2 ** 21;

/**
 * A scorer that blends on the CPU, front to back, by the rules of the renderer: for tools without a GPU, and the reference of other scorers.
 */
export function cpuScorer(cloud: GaussianCloud): ContributionScorer {
  const roots = factors(cloud);
  const none = (): Float32Array => new Float32Array(cloud.count);
  const found = { peak: none(), energy: none(), removal: none() };
  return (camera) => {
    const projected = project(cloud, roots, camera);
    const colors = colorsOf(cloud, projected, camera);
    const order = nearToFar(projected);
    const image = newImage(camera);
    paint(projected, order, camera, colors, image);
    for (const values of Object.values(found)) values.fill(0);
    weigh(projected, order, camera, colors, image, found);
    return found;
  };
}

/** Draws images by the same code: for many small images it is faster than a software GPU. */
export const cpuPainter: Painter = {
  draw: async (cloud, views) => {
    const roots = factors(cloud);
    return views.map((camera) => {
      const projected = project(cloud, roots, camera);
      const image = newImage(camera);
      paint(projected, nearToFar(projected), camera, colorsOf(cloud, projected, camera), image);
      return image;
    });
  },
};

const newImage = ({ width, height }: Camera): Image => new Float32Array(4 * width * height);

/** Places of the splats by depth, equal ones by number. */
function nearToFar({ count, depths }: Projected): Uint32Array {
  if (count > MAX_COUNT) {
    return Uint32Array.from({ length: count }, (_, k) => k).sort((a, b) => depths[a] - depths[b] || a - b);
  }
  // Positive floats are in the order of their bits; numbers sort many times faster than a comparison does.
  const bits = new Uint32Array(depths.buffer, 0, count);
  const keys = new Float64Array(count);
  for (let k = 0; k < count; k++) keys[k] = bits[k] * MAX_COUNT + k;
  keys.sort();
  const order = new Uint32Array(count);
  for (let k = 0; k < count; k++) order[k] = keys[k] % MAX_COUNT;
  return order;
}

/** The part of a row of pixels that an ellipse covers, and how its alpha runs along it. */
class Span {
  first = 0;
  last = 0;
  /** Alpha in the first pixel, before it is capped. */
  alpha = 0;
  /** Its ratio from there to the next pixel, and what that is multiplied by from pixel to pixel. */
  ratio = 1;
  bend = 1;
  readonly #ellipses: Float32Array;
  readonly #width: number;
  #centerX = 0;
  #centerY = 0;
  #xx = 0;
  #xy = 0;
  #yy = 0;
  #opacity = 0;
  /** The largest xx·dx² + 2·xy·dx·dy + yy·dy² that paints. */
  #max = 0;

  constructor({ ellipses }: Projected, { width }: Camera) {
    this.#ellipses = ellipses;
    this.#width = width;
  }

  /** Looks at a splat: what its rows share. */
  begin(k: number): void {
    const ellipses = this.#ellipses;
    const at = 6 * k;
    this.#centerX = ellipses[at] - 0.5;
    this.#centerY = ellipses[at + 1];
    this.#xx = ellipses[at + 2];
    this.#xy = ellipses[at + 3];
    this.#yy = ellipses[at + 4];
    this.#opacity = ellipses[at + 5];
    this.#max = 2 * Math.log(this.#opacity / ALPHA_MIN);
    this.bend = Math.exp(-this.#xx);
  }

  /** Looks at a row of it; false if it paints nothing there. */
  enter(row: number): boolean {
    const xx = this.#xx;
    const yy = this.#yy;
    const dy = row + 0.5 - this.#centerY;
    const middle = this.#xy * dy;
    const inside = middle * middle - xx * (yy * dy * dy - this.#max);
    if (!(inside > 0)) return false;
    const reach = Math.sqrt(inside);
    this.first = Math.max(0, Math.ceil(this.#centerX - (middle + reach) / xx));
    this.last = Math.min(this.#width - 1, Math.floor(this.#centerX - (middle - reach) / xx));
    if (this.last < this.first) return false;
    const dx = this.first - this.#centerX;
    this.alpha = this.#opacity * Math.exp(-0.5 * (xx * dx * dx + yy * dy * dy) - this.#xy * dx * dy);
    this.ratio = Math.exp(-xx * (dx + 0.5) - middle);
    return true;
  }
}

/** First and last row that a splat reaches. */
function rowsOf({ ellipses, halfHeights }: Projected, k: number, { height }: Camera): readonly [number, number] {
  const [center, half] = [ellipses[6 * k + 1] - 0.5, halfHeights[k]];
  return [Math.max(0, Math.ceil(center - half)), Math.min(height - 1, Math.floor(center + half))];
}

/** Blends the splats into an image. @param colors [count, 3] */
function paint(projected: Projected, order: Uint32Array, camera: Camera, colors: Float32Array, image: Image): void {
  const { width } = camera;
  const span = new Span(projected, camera);
  for (const k of order) {
    const [red, green, blue] = [colors[3 * k], colors[3 * k + 1], colors[3 * k + 2]];
    const [top, bottom] = rowsOf(projected, k, camera);
    span.begin(k);
    for (let row = top; row <= bottom; row++) {
      if (!span.enter(row)) continue;
      const { bend } = span;
      let { alpha, ratio } = span;
      const end = 4 * (row * width + span.last);
      for (let at = 4 * (row * width + span.first); at <= end; at += 4, alpha *= ratio, ratio *= bend) {
        const behind = 1 - image[at + 3];
        if (behind < OPAQUE || alpha < ALPHA_MIN) continue;
        const weight = Math.min(ALPHA_MAX, alpha) * behind;
        image[at] += weight * red;
        image[at + 1] += weight * green;
        image[at + 2] += weight * blue;
        image[at + 3] += weight;
      }
    }
  }
}

/**
 * Blends once more, against the finished image: by then the light in front of and on a splat is known, so that the rest of the image is the light behind it, also as it would be without the splat.
 */
function weigh(
  projected: Projected,
  order: Uint32Array,
  camera: Camera,
  colors: Float32Array,
  image: Image,
  found: Contributions,
): void {
  const { width, height } = camera;
  const painted = newImage(camera);
  const span = new Span(projected, camera);
  for (const k of order) {
    const [red, green, blue] = [colors[3 * k], colors[3 * k + 1], colors[3 * k + 2]];
    const [top, bottom] = rowsOf(projected, k, camera);
    let [peak, energy, removal] = [0, 0, 0];
    span.begin(k);
    for (let row = top; row <= bottom; row++) {
      if (!span.enter(row)) continue;
      const { bend } = span;
      let { alpha, ratio } = span;
      const end = 4 * (row * width + span.last);
      for (let at = 4 * (row * width + span.first); at <= end; at += 4, alpha *= ratio, ratio *= bend) {
        const behind = 1 - painted[at + 3];
        if (behind < OPAQUE || alpha < ALPHA_MIN) continue;
        const capped = Math.min(ALPHA_MAX, alpha);
        const weight = capped * behind;
        if (weight > peak) peak = weight;
        energy += weight * weight;
        const brighter = capped / (1 - capped);
        const r = brighter * (image[at] - (painted[at] += weight * red)) - weight * red;
        const g = brighter * (image[at + 1] - (painted[at + 1] += weight * green)) - weight * green;
        const b = brighter * (image[at + 2] - (painted[at + 2] += weight * blue)) - weight * blue;
        painted[at + 3] += weight;
        removal += r * r + g * g + b * b;
      }
    }
    const i = projected.source[k];
    found.peak[i] = peak;
    found.energy[i] = energy / (width * height);
    found.removal[i] = removal / (3 * width * height);
  }
}
