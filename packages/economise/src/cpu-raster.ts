import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { ALPHA_MIN, coloursOf, factors, project, type Projected } from './cpu-project.js';
import type { Image, Painter } from './measure.js';
import type { ContributionScorer, Contributions } from './scorer.js';

const ALPHA_MAX = 0.99;
/** Behind so much nothing more is seen. */
const OPAQUE = 1e-4;
/** Counts are below this: a depth's 32 bits and a number fit the 53 bits of a float64. */
const MAX_COUNT = 2 ** 21;

/**
 * A scorer that blends on the CPU, front to back, by the rules of the renderer: for tools where there is no GPU, and the one whose
 * figures others are held against.
 */
export function cpuScorer(cloud: GaussianCloud): ContributionScorer {
  const roots = factors(cloud);
  const none = (): Float32Array => new Float32Array(cloud.count);
  const found = { peak: none(), energy: none(), removal: none() };
  return (camera) => {
    const projected = project(cloud, roots, camera);
    const colours = coloursOf(cloud, projected, camera);
    const order = nearToFar(projected);
    const image = newImage(camera);
    paint(projected, order, camera, colours, image);
    for (const values of Object.values(found)) values.fill(0);
    weigh(projected, order, camera, colours, image, found);
    return found;
  };
}

/** Draws images by the same code: where many small ones are wanted, it beats a GPU that is none. */
export const cpuPainter: Painter = {
  draw: async (cloud, views) => {
    const roots = factors(cloud);
    return views.map((camera) => {
      const projected = project(cloud, roots, camera);
      const image = newImage(camera);
      paint(projected, nearToFar(projected), camera, coloursOf(cloud, projected, camera), image);
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
  const keys = Float64Array.from({ length: count }, (_, k) => bits[k] * MAX_COUNT + k).sort();
  return Uint32Array.from(keys, (key) => key % MAX_COUNT);
}

/** The part of a row of pixels that an ellipse covers, and how its alpha runs along it. */
interface Span {
  first: number;
  last: number;
  /** Alpha in the first pixel, before it is capped. */
  alpha: number;
  /** Its ratio from there to the next pixel, and what that is multiplied by from pixel to pixel. */
  ratio: number;
  bend: number;
}

/** The span of splat k in a row; false if it paints nothing there. Writes to `span`. */
function spanIn(ellipses: Float32Array, k: number, row: number, { width }: Camera, span: Span): boolean {
  const at = 6 * k;
  const [xx, xy, yy] = [ellipses[at + 2], ellipses[at + 3], ellipses[at + 4]];
  const opacity = ellipses[at + 5];
  const dy = row + 0.5 - ellipses[at + 1];
  // Where xx·dx² + 2·xy·dx·dy + yy·dy² = 2·ln(opacity / ALPHA_MIN).
  const middle = xy * dy;
  const inside = middle * middle - xx * (yy * dy * dy - 2 * Math.log(opacity / ALPHA_MIN));
  if (!(inside > 0)) return false;
  const reach = Math.sqrt(inside);
  const centre = ellipses[at] - 0.5;
  span.first = Math.max(0, Math.ceil(centre - (middle + reach) / xx));
  span.last = Math.min(width - 1, Math.floor(centre - (middle - reach) / xx));
  if (span.last < span.first) return false;
  const dx = span.first - centre;
  span.alpha = opacity * Math.exp(-0.5 * (xx * dx * dx + yy * dy * dy) - xy * dx * dy);
  span.ratio = Math.exp(-xx * (dx + 0.5) - xy * dy);
  span.bend = Math.exp(-xx);
  return true;
}

const newSpan = (): Span => ({ first: 0, last: 0, alpha: 0, ratio: 1, bend: 1 });

/** First and last row that a splat reaches. */
function rowsOf({ ellipses, halfHeights }: Projected, k: number, { height }: Camera): readonly [number, number] {
  const [centre, half] = [ellipses[6 * k + 1] - 0.5, halfHeights[k]];
  return [Math.max(0, Math.ceil(centre - half)), Math.min(height - 1, Math.floor(centre + half))];
}

/** Blends the splats into an image. @param colours [count, 3] */
function paint(projected: Projected, order: Uint32Array, camera: Camera, colours: Float32Array, image: Image): void {
  const { width } = camera;
  const span = newSpan();
  for (const k of order) {
    const [red, green, blue] = [colours[3 * k], colours[3 * k + 1], colours[3 * k + 2]];
    const [top, bottom] = rowsOf(projected, k, camera);
    for (let row = top; row <= bottom; row++) {
      if (!spanIn(projected.ellipses, k, row, camera, span)) continue;
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
 * Blends once more, against the finished image: what lies in front of and on a splat is known by then, so that the rest of the image is what lies
 * behind, and what it would be if the splat did not stand before it.
 */
function weigh(
  projected: Projected,
  order: Uint32Array,
  camera: Camera,
  colours: Float32Array,
  image: Image,
  found: Contributions,
): void {
  const { width, height } = camera;
  const painted = newImage(camera);
  const span = newSpan();
  for (const k of order) {
    const [red, green, blue] = [colours[3 * k], colours[3 * k + 1], colours[3 * k + 2]];
    const [top, bottom] = rowsOf(projected, k, camera);
    let [peak, energy, removal] = [0, 0, 0];
    for (let row = top; row <= bottom; row++) {
      if (!spanIn(projected.ellipses, k, row, camera, span)) continue;
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
