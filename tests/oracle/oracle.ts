/**
 * The reference image: 3D Gaussian splatting (Kerbl et al. 2023) in float64, written to be read.
 * Renderers are measured against it; the rules it follows are measured against reference images of gsplat.
 */
import {
  eyeOf,
  GaussianSplatError,
  inverse,
  multiply,
  normalize,
  subtract,
  validateCamera,
  validateCloud,
  type Camera,
  type GaussianCloud,
  type Matrix4,
  type Vector3,
} from '@gaussian-splat/core';
import {
  addBackground,
  blend,
  blendByPixel,
  emptyImage,
  nearestFirst,
  type OracleImage,
  type OracleLayer,
  type ScreenSplat,
} from './blend.js';
import type { SplatCut } from '@gaussian-splat/renderer/modifiers';
import { cutCloud } from './cut.js';
import { densestDepth } from './densest.js';
import { footprintOf } from './footprint.js';
import { projectEllipse, toCamera, worldPosition } from './projection.js';
import { RULES, type Mode, type Rules, type RuleSet } from './rules.js';
import { splatColor } from './sh.js';
import { thinned } from './thinned.js';

export type { OracleImage } from './blend.js';
export type { Mode, Rules, RuleSet } from './rules.js';

export interface OracleOptions {
  readonly rules: RuleSet | Rules;
  readonly mode: Mode;
  /** Red, green, blue behind everything; default black. */
  readonly background?: Vector3;
  /** [height, width] depth of other contents of the image, world units in camera axes: splats behind it are hidden. */
  readonly depth?: ArrayLike<number>;
  /** Layers of color among the splats. */
  readonly layers?: readonly OracleLayer[];
  /** [N] one key for each splat of the cloud, blended ascending; default float32 z in camera axes. */
  readonly depthKeys?: ArrayLike<number>;
  /** `pixel`: each pixel blends by the depth at which each splat is densest along its ray, regardless of keys. Default `center`. */
  readonly order?: 'center' | 'pixel';
  /** Whether the image gets `depths`. */
  readonly measuresDepths?: boolean;
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

  const image = emptyImage(camera.width, camera.height, cloud.count, options.measuresDepths);
  const splats = screenSplats(cloud, camera, rules, options);
  blenderOf(options)(image, nearestFirst(splats), rules, options.depth, options.layers);
  image.depths = image.sums?.result();
  if (options.background) addBackground(image, options.background);
  return image;
}

const blenderOf = ({ order }: Pick<OracleOptions, 'order'>): typeof blend => (order === 'pixel' ? blendByPixel : blend);

/** A cloud that stands somewhere in a world. */
export interface PlacedCloud {
  readonly cloud: GaussianCloud;
  readonly mode: Mode;
  readonly sceneToWorld?: Matrix4;
  readonly opacity?: number;
  readonly crop?: { readonly min: Vector3; readonly max: Vector3 };
  readonly cuts?: readonly SplatCut[];
}

/** Draws clouds that stand in one world, blended together. Each is seen as it is in its own frame: its harmonics turn with it. */
export function renderOracleWorld(
  placed: readonly PlacedCloud[],
  camera: Camera,
  options: Pick<OracleOptions, 'rules' | 'depth' | 'layers' | 'background' | 'order' | 'measuresDepths'>,
): OracleImage {
  const rules = typeof options.rules === 'string' ? RULES[options.rules] : options.rules;
  let first = 0;
  const splats = placed.flatMap(({ cloud: whole, mode, sceneToWorld, opacity = 1, crop, cuts = [] }, owner) => {
    const { cloud, recolor } = cutCloud(whole, cuts, sceneToWorld);
    const worldToCamera = sceneToWorld ? multiply(camera.worldToCamera, sceneToWorld) : camera.worldToCamera;
    const isInside = (i: number): boolean =>
      crop === undefined || worldPosition(cloud, i).every((v, axis) => v >= crop.min[axis] && v <= crop.max[axis]);
    const faded = { ...cloud, opacities: cloud.opacities.map((own, i) => (isInside(i) ? thinned(own, opacity) : 0)) };
    const all = screenSplats(faded, { ...camera, worldToCamera }, rules, { ...options, mode });
    const start = first;
    first += cloud.count;
    return all
      .filter(({ index }) => faded.opacities[index] > 0)
      .map((s) => ({ ...s, color: recolor(s.index, s.color), index: start + s.index, owner }));
  });
  const image = emptyImage(camera.width, camera.height, first, options.measuresDepths);
  blenderOf(options)(image, nearestFirst(splats), rules, options.depth, options.layers);
  image.depths = image.sums?.result();
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
  const toWorld = inverse(camera.worldToCamera);
  const axis: Vector3 = [toWorld[2], toWorld[6], toWorld[10]];
  const splats: ScreenSplat[] = [];
  for (let index = 0; index < cloud.count; index++) {
    const position = worldPosition(cloud, index);
    const center = toCamera(camera, position);
    const z = center[2];
    if (z < camera.near || z > camera.far || (z === camera.near && !rules.drawsOnNearPlane)) continue;

    const ellipse = projectEllipse(cloud, index, camera, center, rules);
    const opacity = cloud.opacities[index] * (options.mode === 'antialiased' ? ellipse.compensation : 1);
    const color = splatColor(cloud, index, normalize(camera.orthographic ? axis : subtract(position, eye)));
    const key = options.depthKeys ? options.depthKeys[index] : Math.fround(z);
    requireFinite(index, [...Object.values(ellipse.conic), ellipse.x, ellipse.y, opacity, ...color, key]);
    splats.push({
      index,
      owner: 0,
      key,
      depth: z,
      ellipse,
      footprint: footprintOf(ellipse, opacity, camera, rules),
      opacity,
      color,
      ...((options.order === 'pixel' || options.measuresDepths) && {
        depthAt: densestDepth(cloud, index, camera, center, rules, options.measuresDepths ? ellipse : undefined),
      }),
    });
  }
  return splats;
}

function requireFinite(index: number, values: number[]): void {
  if (values.every(Number.isFinite)) return;
  throw new GaussianSplatError('argument/cloud', {
    where: `splat ${index}`,
    expected: 'finite conic, center, opacity, color and depth key',
    found: values.join(', '),
    remedy: 'leave out splats that isUsable() refuses before asking the oracle',
  });
}
