/** Camera views in all forms that pages and files use, and their conversion to poses. */
import { GaussianSplatError, inverse, length, normalize, subtract, type Vector3 } from '@gaussian-splat/core';
import { fieldOfViewGrammar, orbitGrammar, targetGrammar, type AttributeGrammar } from './grammar.js';
import { toViewer, type CameraPose, type ViewerFrame } from './orbit.js';
import { poseOf, type CameraSettings, type SceneBounds } from './settings.js';

/** A view in the syntax of the attributes. Omitted parts keep their current value. */
export interface OrbitView {
  /** Value in the syntax of `camera-orbit`. */
  readonly orbit?: string;
  /** Value in the syntax of `camera-target`. */
  readonly target?: string;
  /** Value in the syntax of `field-of-view`. */
  readonly fieldOfView?: string;
}

/** A camera of a trainer's `cameras.json`: in scene coordinates, OpenCV axes (x right, y down, z forward). */
export interface TrainerView {
  /** Position of the eye, world units. */
  readonly position: readonly number[];
  /** 3x3 rotation from camera to world as an array of rows. Its columns are the axes of the camera. */
  readonly rotation: readonly (readonly number[])[];
  /**
   * Image height in pixels, which with the focal length `fy` in pixels defines the field of view. Without both, the
   * current field of view remains.
   */
  readonly height?: number;
  readonly fy?: number;
}

/** A camera as a matrix in scene coordinates, with OpenCV axes: 16 numbers row by row, or four rows of four. */
export interface MatrixView {
  readonly worldToCamera: readonly number[] | readonly (readonly number[])[];
  /**
   * 3x3 intrinsic matrix in pixels, which with the image height in pixels defines the field of view. Without both, the
   * current field of view remains.
   */
  readonly K?: readonly (readonly number[])[];
  readonly height?: number;
}

/** A camera as the positions of its eye and its target, three numbers each. */
export interface LookView {
  readonly position: readonly number[];
  readonly lookAt: readonly number[];
  /**
   * Coordinate system of the positions. Default: `viewer`, the space of `camera-target`. `supersplat` is the space of
   * SuperSplat's viewer, which rotates every scene by 180 degrees around z.
   */
  readonly space?: 'viewer' | 'supersplat';
  /** Field of view along the longer side of the image, degrees. Default: the current one. */
  readonly fov?: number;
}

/** A camera view. The camera stays upright: the roll of a matrix is ignored. */
export type CameraView = OrbitView | TrainerView | MatrixView | LookView;

/** State of the element that {@link poseOfView} needs. */
export interface ViewContext {
  readonly settings: CameraSettings;
  readonly bounds: SceneBounds;
  readonly frame: ViewerFrame;
  /** Aspect ratio of the image, width / height. */
  readonly aspect: number;
  /** Current goal of the camera, with the values for parts that a view omits. */
  readonly from: CameraPose;
}

/** Returns the pose of a view. @throws GaussianSplatError `argument/camera` for a malformed view */
export function poseOfView(view: CameraView, context: ViewContext): CameraPose {
  if (typeof view !== 'object' || view === null) throw fail('view', FORMS, view);
  if ('worldToCamera' in view) return ofMatrix(view, context);
  if ('rotation' in view) return ofTrainer(view, context);
  if ('lookAt' in view) return ofLook(view, context);
  return ofOrbit(view, context);
}

const FORMS =
  '{ orbit, target, fieldOfView } as in the attributes, { position, lookAt }, { position, rotation } of a cameras.json, or { worldToCamera }';

function ofOrbit(
  { orbit, target, fieldOfView }: OrbitView,
  { settings, bounds, aspect, from }: ViewContext,
): CameraPose {
  if (orbit === undefined && target === undefined && fieldOfView === undefined)
    throw fail('view', FORMS, 'none of these');
  const read = <T>(name: string, text: string | undefined, grammar: AttributeGrammar<T>): T | undefined => {
    if (text === undefined) return undefined;
    const value = grammar.parse(String(text));
    if (value === null) throw fail(`view.${name}`, grammar.expected, text);
    return value;
  };
  const wanted = {
    orbit: read('orbit', orbit, orbitGrammar('auto')),
    target: read('target', target, targetGrammar),
    fieldOfView: read('fieldOfView', fieldOfView, fieldOfViewGrammar),
  };
  const pose = poseOf(
    {
      ...settings,
      orbit: wanted.orbit ?? settings.orbit,
      target: wanted.target ?? settings.target,
      // The framing distance depends on the field of view.
      fieldOfView: wanted.fieldOfView ?? from.fieldOfView,
    },
    bounds,
    aspect,
  );
  const { theta, phi, radius, x, y, z } = pose;
  return {
    ...from,
    ...(wanted.orbit && { theta, phi, radius }),
    ...(wanted.target && { x, y, z }),
    fieldOfView: pose.fieldOfView,
  };
}

function ofTrainer({ position, rotation, height, fy }: TrainerView, context: ViewContext): CameraPose {
  const eye = vector('view.position', position);
  if (!isRows(rotation, 3)) throw fail('view.rotation', 'a 3x3 array of numbers, camera to world', rotation);
  const forward: Vector3 = [rotation[0][2], rotation[1][2], rotation[2][2]];
  return ofRay(toViewer(context.frame, eye), toViewer(context.frame, forward), vertical(height, fy), context);
}

function ofMatrix({ worldToCamera, K, height }: MatrixView, context: ViewContext): CameraPose {
  const m = (worldToCamera as unknown[]).flat?.() as number[];
  const isMatrix = m?.length === 16 && m.every(Number.isFinite) && Math.hypot(m[12], m[13], m[14], m[15] - 1) < 1e-6;
  if (!isMatrix) throw fail('view.worldToCamera', 'a 4x4 array of numbers with the last row 0, 0, 0, 1', worldToCamera);
  const back = inverse(m);
  return ofRay(
    toViewer(context.frame, [back[3], back[7], back[11]]),
    toViewer(context.frame, [m[8], m[9], m[10]]),
    vertical(height, K?.[1]?.[1]),
    context,
  );
}

function ofLook({ position, lookAt, space, fov }: LookView, context: ViewContext): CameraPose {
  const [eye, target] = [vector('view.position', position), vector('view.lookAt', lookAt)].map((point) =>
    space === 'supersplat' ? toViewer(context.frame, [-point[0], -point[1], point[2]]) : point,
  );
  const way = subtract(target, eye);
  if (!(length(way) > 0)) throw fail('view.lookAt', 'another point than view.position', lookAt);
  // `fov` is the angle along the longer side of the image; poses have the vertical one.
  const half = fov === undefined ? undefined : Math.tan((fov * Math.PI) / 360) / Math.max(1, context.aspect);
  const pose = ofRay(eye, way, half === undefined ? undefined : 2 * Math.atan(half), context);
  return { ...pose, radius: length(way), x: target[0], y: target[1], z: target[2] };
}

/**
 * Returns the vertical field of view, radians, of a camera with the image height and focal length in pixels; undefined
 * without both.
 */
const vertical = (height: number | undefined, focal: number | undefined): number | undefined =>
  height! > 0 && focal! > 0 ? 2 * Math.atan(height! / (2 * focal!)) : undefined;

/** Minimum distance of the pivot in front of the eye, in radii of the scene. */
const MIN_AHEAD = 0.1;
/** Sine of the angle to the vertical below which a view is straight down or up, for matrices in float32. */
const UPRIGHT = 1e-6;

/**
 * Returns the pose for an eye and a direction. Its target is the point on the ray nearest to the center of the scene.
 */
function ofRay(eye: Vector3, direction: Vector3, fieldOfView: number | undefined, context: ViewContext): CameraPose {
  const { bounds, frame, from } = context;
  const forward = normalize(direction);
  const toMiddle = subtract(toViewer(frame, bounds.center), eye);
  const along = toMiddle[0] * forward[0] + toMiddle[1] * forward[1] + toMiddle[2] * forward[2];
  const radius = Math.max(MIN_AHEAD * bounds.radius, along);
  const [x, y, z] = eye.map((value, axis) => value + radius * forward[axis]);
  const isUpright = Math.hypot(forward[0], forward[2]) < UPRIGHT;
  return {
    // A view straight down or up has no azimuth of its own.
    theta: isUpright ? from.theta : Math.atan2(-forward[0], -forward[2]),
    phi: Math.acos(Math.min(1, Math.max(-1, -forward[1]))),
    radius,
    ...{ x, y, z },
    fieldOfView: fieldOfView ?? from.fieldOfView,
  };
}

const isRows = (rows: unknown, size: number): boolean =>
  Array.isArray(rows) &&
  rows.length === size &&
  rows.every((row) => Array.isArray(row) && row.length === size && row.every(Number.isFinite));

function vector(where: string, value: readonly number[]): Vector3 {
  if (!Array.isArray(value) || value.length !== 3 || !value.every(Number.isFinite))
    throw fail(where, 'three numbers', value);
  return value as unknown as Vector3;
}

export function fail(where: string, expected: string, found: unknown): GaussianSplatError {
  const text = typeof found === 'string' ? found : (JSON.stringify(found) ?? 'nothing');
  return new GaussianSplatError('argument/camera', {
    where,
    expected,
    found: text.length > 120 ? `${text.slice(0, 120)}…` : text,
    remedy: 'see "Move it by script" in docs/guide/camera.md',
  });
}
