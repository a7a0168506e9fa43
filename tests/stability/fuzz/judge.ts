/** Draws a case, of the fuzzer or of a row, and says how far it is from the float64 image, and why. */
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import type { RasterizerName } from '@gaussian-splat/renderer';
import { renderOracle, type Mode, type OracleImage, type Rules } from '../../oracle/oracle.js';
import { toCamera, worldPosition } from '../../oracle/projection.js';
import { RULES } from '../../oracle/rules.js';
import { isSwiftShader } from '../../support/limit.js';
import { psnr } from '../../support/metrics.js';
import { toRgba } from '../../oracle/oracle.js';
import { compareImage, draw, notFinite } from '../support/images.js';
import { cameraOfRecipe, cloudOfRecipe, type SceneRecipe } from '../support/random-scene.js';

/**
 * Why an image may be under 59 dB: `threshold`, pixels in which a splat is within rounding of a rule's limit or of another splat's depth, so that float32 and float64 may rightly differ; `stop`, quads cannot end a pixel whose next splat would leave less than 1e-4 of the light, as the
 * reference does, so that up to 0.5 % of another color is added to nearly opaque pixels; `float16`, rounding of the blend target. `none` is a fault.
 */
export type Cause = 'fine' | 'threshold' | 'stop' | 'float16' | 'none';

export interface Verdict {
  /** dB over covered pixels. */
  readonly decibels: number;
  /** The same without the pixels that a rounding decides. */
  readonly withoutThresholds: number;
  readonly cause: Cause;
  /** Numbers of the image that are not finite. */
  readonly notFinite: number;
}

export interface Subject {
  readonly device: GPUDevice;
  /** A device that blends in float32; undefined if there is none. */
  readonly precise: GPUDevice | undefined;
  readonly rasterizer: RasterizerName;
}

const FINE = 59;
/** Relative rounding of alpha: 14 bits of the covariance's root, twice, times an exponent of up to 5.5. */
const ALPHA_ROUNDING = 5e-4;
/** Transmittance is a product of all that lies in front. */
const LIGHT_ROUNDING = 2e-2;
/** float32 depths from a matrix product, and keys of 24 bits over the visible range. */
const DEPTH_ROUNDING = 1e-6;
/** A pixel is decided by a rounding if the images on both sides of the limit differ by this much in it. */
const VISIBLE = 2e-4;

export async function judge(recipe: SceneRecipe, subject: Subject): Promise<Verdict> {
  const { mode, turning } = recipe;
  return judgeView({ cloud: cloudOfRecipe(recipe), camera: cameraOfRecipe(recipe.camera), mode, turning }, subject);
}

/** The scene to draw: `turning` as the `DrawOptions` of the rows have it. */
export interface JudgedView {
  readonly cloud: GaussianCloud;
  readonly camera: Camera;
  readonly mode: Mode;
  readonly turning: boolean;
}

/** The same for a scene and a camera that no recipe made. */
export async function judgeView(view: JudgedView, { device, precise, rasterizer }: Subject): Promise<Verdict> {
  const { cloud, camera, mode, turning } = view;
  const threads = isSwiftShader(device) ? 'serial' : 'parallel';
  const pixels = await draw(device, cloud, camera, { rasterizer, mode, turning, threads });
  const oracle = renderOracle(cloud, camera, { rules: 'gsplat', mode });
  const decibels = compareImage(pixels, oracle).psnr;
  const broken = notFinite(pixels);
  if (decibels >= FINE || broken > 0) {
    return { decibels, withoutThresholds: decibels, cause: broken ? 'none' : 'fine', notFinite: broken };
  }
  const sure = surePixels(cloud, camera, mode, oracle);
  const withoutThresholds = overPixels(pixels, oracle, sure);
  const verdict = (cause: Cause): Verdict => ({ decibels, withoutThresholds, cause, notFinite: 0 });
  if (withoutThresholds >= FINE) return verdict('threshold');
  if (rasterizer === 'tiles') return verdict('none');
  const endless = renderOracle(cloud, camera, { rules: ENDLESS, mode });
  if (overPixels(pixels, endless, sure) >= FINE) return verdict('stop');
  if (precise === undefined) return verdict('none');
  const options = { rasterizer, mode, turning, accumulation: 'rgba32float', threads } as const;
  const better = overPixels(await draw(precise, cloud, camera, options), endless, sure);
  return verdict(better >= FINE ? 'float16' : 'none');
}

/** The rules without an end to pixels. */
const ENDLESS: Rules = { ...RULES.gsplat, minTransmittance: 0, stopsAtEquality: false };

/** [pixels] 1 if no rounding decides and either image shows a splat. */
function surePixels(cloud: GaussianCloud, camera: Camera, mode: Mode, oracle: OracleImage): Uint8Array {
  const base = toRgba(oracle);
  const sure = new Uint8Array(oracle.transmittance.length).fill(1);
  for (const image of neighbors(cloud, camera, mode)) {
    const other = toRgba(image);
    for (let i = 0; i < base.length; i++) if (Math.abs(base[i] - other[i]) > VISIBLE) sure[i >> 2] = 0;
  }
  return sure;
}

/** The image as it would be with each limit a rounding lower or higher, and depths a rounding apart. */
function* neighbors(cloud: GaussianCloud, camera: Camera, mode: Mode): Generator<OracleImage> {
  const { gsplat } = RULES;
  const { near } = camera;
  const limits: Partial<Rules>[] = [-1, 1].flatMap((side) => [
    { minAlpha: gsplat.minAlpha * (1 + side * ALPHA_ROUNDING) },
    { minTransmittance: gsplat.minTransmittance * (1 + side * LIGHT_ROUNDING) },
  ]);
  for (const limit of limits) yield renderOracle(cloud, camera, { rules: { ...gsplat, ...limit }, mode });
  const places = Array.from({ length: cloud.count }, (_, i) => toCamera(camera, worldPosition(cloud, i)));
  // A depth near 0 is the difference of large products: points far aside have the rounding of their distance.
  const reach = places.reduce((max, place) => Math.max(max, Math.hypot(...place)), near);
  for (const side of [-1, 1]) {
    yield renderOracle(cloud, { ...camera, near: near + side * DEPTH_ROUNDING * reach }, { rules: 'gsplat', mode });
  }
  const depths = Float64Array.from(places, ([, , z]) => z);
  for (const spread of [1, -1]) {
    const depthKeys = depths.map((z, i) => z * (1 + ((i * 7919) % 13) * spread * (DEPTH_ROUNDING / 13)));
    yield renderOracle(cloud, camera, { rules: 'gsplat', mode, depthKeys });
  }
  // Equal and nearly equal depths the other way around.
  const step = DEPTH_ROUNDING * Math.max(1, ...depths.map(Math.abs));
  yield renderOracle(cloud, camera, {
    rules: 'gsplat',
    mode,
    depthKeys: depths.map((z, i) => Math.round(z / step) - i / (cloud.count + 1)),
  });
}

/** dB over the given pixels that any splat covers; infinite if there is none. */
function overPixels(pixels: Float32Array, oracle: OracleImage, sure: Uint8Array): number {
  const mask = sure.map((one, i) => (one && oracle.contributors[i] > 0 ? 1 : 0));
  if (!mask.includes(1)) return Infinity;
  return psnr(pixels, toRgba(oracle), { mask, channels: 4 });
}
