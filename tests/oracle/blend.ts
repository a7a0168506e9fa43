/** Front-to-back alpha compositing of ellipses into an image. */
import type { Vector3 } from '@gaussian-splat/core';
import { DepthAndIds, type OracleDepths } from './depth-and-ids.js';
import type { PixelRect } from './footprint.js';
import type { Ellipse } from './projection.js';
import type { Rules } from './rules.js';

/** A splat that is ready to be blended. */
export interface ScreenSplat {
  /** Its place in the cloud. */
  readonly index: number;
  /** Index of the cloud among those of the world. */
  readonly owner: number;
  /** Splats are blended by ascending key, equal keys by index. */
  readonly key: number;
  /** Depth in camera axes. */
  readonly depth: number;
  readonly ellipse: Ellipse;
  readonly footprint: PixelRect;
  /** After compensation, 0..1. */
  readonly opacity: number;
  /** Red, green, blue; 0 or more, may exceed 1. */
  readonly color: Vector3;
  /** Depth in camera axes at which the splat is densest along the ray of a pixel, 0 if that is behind the camera. */
  readonly depthAt?: (column: number, row: number) => number;
}

/** The oracle's image. Rows run from the top, pixels within a row from the left. */
export interface OracleImage {
  readonly width: number;
  readonly height: number;
  /** [height, width, 3] red, green, blue, weighted by alpha (premultiplied), background included; not clamped. */
  readonly color: Float64Array;
  /** [height, width] visible fraction of the background, 0..1. Alpha is 1 less this. */
  readonly transmittance: Float64Array;
  /** [height, width] number of splats that were added to the pixel. */
  readonly contributors: Uint32Array;
  /** [height, width] depth of the splat that leaves half of the light or less; 0 if none does. */
  readonly medianDepth: Float64Array;
  /** [N] largest weight alpha·T that each splat of the cloud has in any pixel; 0 if it is not seen. */
  readonly maxWeight: Float64Array;
  /** Depth and identity, if the options ask for them. */
  depths?: OracleDepths;
}

/** An image that splats are blended into. */
export interface Canvas extends OracleImage {
  readonly sums?: DepthAndIds | undefined;
}

export function emptyImage(width: number, height: number, splatCount: number, measuresDepths = false): Canvas {
  return {
    sums: measuresDepths ? new DepthAndIds(width, height) : undefined,
    width,
    height,
    color: new Float64Array(3 * width * height),
    transmittance: new Float64Array(width * height).fill(1),
    contributors: new Uint32Array(width * height),
    medianDepth: new Float64Array(width * height),
    maxWeight: new Float64Array(splatCount),
  };
}

/** The splats in blending order, nearest first. Does not change the given array. */
export function nearestFirst(splats: readonly ScreenSplat[]): ScreenSplat[] {
  return [...splats].sort((a, b) => a.key - b.key || a.index - b.index);
}

/** Other contents of the image, pixel by pixel, at their depth among the splats. */
export interface OracleLayer {
  /** [height, width] depth in camera axes; Infinity if there is nothing. */
  readonly depth: ArrayLike<number>;
  /** [height, width, 4] premultiplied red, green, blue, and the covered fraction. */
  readonly color: ArrayLike<number>;
}

/** Blends the layers of a pixel that are nearer than a depth. */
class LayersAmong {
  readonly #image: OracleImage;
  readonly #layers: readonly OracleLayer[];
  readonly #passed: Set<OracleLayer>[];

  constructor(image: Canvas, layers: readonly OracleLayer[]) {
    this.#image = image;
    this.#layers = layers;
    this.#passed = layers.length === 0 ? [] : Array.from(image.transmittance, () => new Set<OracleLayer>());
  }

  passUpTo(pixel: number, depth: number): void {
    const due = this.#layers.filter((layer) => layer.depth[pixel] < depth && !this.#passed[pixel].has(layer));
    for (const layer of due.sort((a, b) => a.depth[pixel] - b.depth[pixel])) {
      this.#passed[pixel].add(layer);
      const { color, transmittance } = this.#image;
      for (let k = 0; k < 3; k++) color[3 * pixel + k] += transmittance[pixel] * layer.color[4 * pixel + k];
      transmittance[pixel] *= 1 - layer.color[4 * pixel + 3];
    }
  }

  /** Contents behind all splats. */
  passAll(finished: ArrayLike<number>): void {
    if (this.#layers.length === 0) return;
    for (let pixel = 0; pixel < finished.length; pixel++) if (!finished[pixel]) this.passUpTo(pixel, Infinity);
  }
}

/**
 * Blends splats, nearest first, into the image, pixel by pixel: C += T·alpha·c, then T *= 1 - alpha.
 * @param limit [height, width] depth of other contents of the image: splats behind it are hidden
 */
export function blend(
  image: Canvas,
  splats: readonly ScreenSplat[],
  rules: Rules,
  limit?: ArrayLike<number>,
  layers: readonly OracleLayer[] = [],
): void {
  const finished = new Uint8Array(image.width * image.height);
  const among = new LayersAmong(image, layers);
  for (const splat of splats) blendSplat(image, finished, splat, rules, limit, among);
  among.passAll(finished);
}

/** The blending state of one pixel. */
interface Fragment {
  readonly splat: ScreenSplat;
  readonly alpha: number;
  readonly depth: number;
}

/**
 * Blends splats in a separate order for each pixel: by the depth at which each is densest along its ray, equal depths in the given order. A splat is hidden if that depth is behind the limit.
 */
export function blendByPixel(
  image: Canvas,
  splats: readonly ScreenSplat[],
  rules: Rules,
  limit?: ArrayLike<number>,
  layers: readonly OracleLayer[] = [],
): void {
  const among = new LayersAmong(image, layers);
  const rows: ScreenSplat[][] = Array.from({ length: image.height }, () => []);
  for (const splat of splats) {
    for (let row = splat.footprint.top; row < splat.footprint.bottom; row++) rows[row].push(splat);
  }
  const finished = new Uint8Array(image.width * image.height);
  for (const [row, inRow] of rows.entries()) {
    const fragments: Fragment[][] = Array.from({ length: image.width }, () => []);
    for (const splat of inRow) {
      const hopeless = hopelessPower(splat, rules);
      for (let column = splat.footprint.left; column < splat.footprint.right; column++) {
        const alpha = alphaAt(splat, column, row, rules, hopeless);
        if (alpha === 0) continue;
        const depth = splat.depthAt!(column, row);
        if (!limit || depth <= limit[row * image.width + column]) fragments[column].push({ splat, alpha, depth });
      }
    }
    for (const [column, found] of fragments.entries()) {
      const pixel = row * image.width + column;
      found.sort((a, b) => a.depth - b.depth);
      for (const { splat, alpha, depth } of found) {
        if (!finished[pixel]) among.passUpTo(pixel, depth);
        blendFragment(image, finished, pixel, splat, alpha, depth, rules);
      }
    }
  }
  among.passAll(finished);
}

function blendSplat(
  image: Canvas,
  finished: Uint8Array,
  splat: ScreenSplat,
  rules: Rules,
  limit: ArrayLike<number> | undefined,
  among: LayersAmong,
): void {
  const { width } = image;
  const { footprint } = splat;
  const hopeless = hopelessPower(splat, rules);
  for (let row = footprint.top; row < footprint.bottom; row++) {
    for (let column = footprint.left; column < footprint.right; column++) {
      const pixel = row * width + column;
      if (finished[pixel] || (limit && splat.depth > limit[pixel])) continue;
      const alpha = alphaAt(splat, column, row, rules, hopeless);
      if (alpha === 0) continue;
      among.passUpTo(pixel, splat.depth);
      blendFragment(image, finished, pixel, splat, alpha, splat.depth, rules);
    }
  }
}

/** exp is the dear part: below this power alpha is surely under minAlpha. The margin leaves the decision to the test. */
const hopelessPower = ({ opacity }: ScreenSplat, { minAlpha }: Rules): number => Math.log(minAlpha / opacity) - 1e-6;

/** 0 if the splat does not reach the pixel. */
function alphaAt(
  { ellipse, opacity }: ScreenSplat,
  column: number,
  row: number,
  rules: Rules,
  hopeless: number,
): number {
  const { xx, xy, yy } = ellipse.conic;
  const dx = column + 0.5 - ellipse.x;
  const dy = row + 0.5 - ellipse.y;
  const power = -0.5 * (xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy);
  if (power > 0 || power < hopeless) return 0;
  const alpha = Math.min(rules.maxAlpha, opacity * Math.exp(power));
  return alpha < rules.minAlpha ? 0 : alpha;
}

function blendFragment(
  image: Canvas,
  finished: Uint8Array,
  pixel: number,
  splat: ScreenSplat,
  alpha: number,
  depth: number,
  rules: Rules,
): void {
  const { color, transmittance, contributors, maxWeight, medianDepth, sums } = image;
  const { index, color: own } = splat;
  if (finished[pixel]) return;
  const before = transmittance[pixel];
  const after = before * (1 - alpha);
  if (after < rules.minTransmittance || (rules.stopsAtEquality && after === rules.minTransmittance)) {
    finished[pixel] = 1;
    return;
  }
  const weight = before * alpha;
  for (let k = 0; k < 3; k++) color[3 * pixel + k] += weight * own[k];
  transmittance[pixel] = after;
  if (before > 0.5 && after <= 0.5) medianDepth[pixel] = depth;
  sums?.add(pixel, splat, before, after);
  contributors[pixel]++;
  if (weight > maxWeight[index]) maxWeight[index] = weight;
}

/** Adds what shines through: C += T·background. */
export function addBackground(image: Canvas, background: Vector3): void {
  for (let i = 0; i < image.color.length; i++) {
    image.color[i] += image.transmittance[Math.floor(i / 3)] * background[i % 3];
  }
}
