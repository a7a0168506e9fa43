/**
 * The true image: 3D Gaussian splatting (Kerbl et al. 2023) in float64, written to be read.
 * Renderers are measured against it; the rules it follows are measured against reference images of gsplat.
 */
import {
  eyeOf,
  GaussianSplatError,
  normalize,
  subtract,
  validateCamera,
  validateCloud,
  type Camera,
  type GaussianCloud,
  type Vector3,
} from '@gaussian-splat/core';
import { addBackground, blend, emptyImage, nearestFirst, type OracleImage, type ScreenSplat } from './blend.js';
import { footprintOf } from './footprint.js';
import { projectEllipse, toCamera, worldPosition } from './projection.js';
import { RULES, type Mode, type Rules, type RuleSet } from './rules.js';
import { splatColor } from './sh.js';

export type { OracleImage } from './blend.js';
export type { Mode, Rules, RuleSet } from './rules.js';

export interface OracleOptions {
  readonly rules: RuleSet | Rules;
  readonly mode: Mode;
  /** Red, green, blue behind everything; default black. */
  readonly background?: Vector3;
  /** [N] one key for each splat of the cloud, blended ascending; default float32 z in camera axes. */
  readonly depthKeys?: ArrayLike<number>;
}

/**
 * Draws a cloud. Values are the cloud's own float32 numbers; all arithmetic is float64.
 * Throws `argument/camera` and `argument/cloud`, the latter also for a splat that has no finite image: leave unusable
 * splats out first (`keepUsable`).
 */
export function renderOracle(cloud: GaussianCloud, camera: Camera, options: OracleOptions): OracleImage {
  validateCloud(cloud);
  validateCamera(camera);
  const rules = typeof options.rules === 'string' ? RULES[options.rules] : options.rules;

  const image = emptyImage(camera.width, camera.height, cloud.count);
  const splats = screenSplats(cloud, camera, rules, options);
  blend(image, nearestFirst(splats), rules);
  if (options.background) addBackground(image, options.background);
  return image;
}

/** [height, width, 4] premultiplied RGBA, as a renderer's float image has it. For images without a background. */
export function toRgba({ color, transmittance }: OracleImage): Float64Array {
  const rgba = new Float64Array(4 * transmittance.length);
  for (let pixel = 0; pixel < transmittance.length; pixel++) {
    rgba.set(color.subarray(3 * pixel, 3 * pixel + 3), 4 * pixel);
    rgba[4 * pixel + 3] = 1 - transmittance[pixel];
  }
  return rgba;
}

/** All splats of the cloud between the near and the far plane, on the screen. */
function screenSplats(cloud: GaussianCloud, camera: Camera, rules: Rules, options: OracleOptions): ScreenSplat[] {
  const eye = eyeOf(camera.worldToCamera);
  const splats: ScreenSplat[] = [];
  for (let index = 0; index < cloud.count; index++) {
    const position = worldPosition(cloud, index);
    const center = toCamera(camera, position);
    const z = center[2];
    if (z < camera.near || z > camera.far || (z === camera.near && !rules.drawsOnNearPlane)) continue;

    const ellipse = projectEllipse(cloud, index, camera, center, rules);
    const opacity = cloud.opacities[index] * (options.mode === 'antialiased' ? ellipse.compensation : 1);
    const color = splatColor(cloud, index, normalize(subtract(position, eye)));
    const key = options.depthKeys ? options.depthKeys[index] : Math.fround(z);
    requireFinite(index, [...Object.values(ellipse.conic), ellipse.x, ellipse.y, opacity, ...color, key]);
    splats.push({ index, key, ellipse, footprint: footprintOf(ellipse, opacity, camera, rules), opacity, color });
  }
  return splats;
}

function requireFinite(index: number, values: number[]): void {
  if (values.every(Number.isFinite)) return;
  throw new GaussianSplatError('argument/cloud', {
    where: `splat ${index}`,
    expected: 'finite conic, centre, opacity, colour and depth key',
    found: values.join(', '),
    remedy: 'leave out splats that isUsable() refuses before asking the oracle',
  });
}
