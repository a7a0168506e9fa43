/** Converts camera attributes for a given scene and frame: settings with `auto` and `%` become a pose. */
import { subtract, type Bounds, type CloudHints, type Vector3 } from '@gaussian-splat/core';
import type { AngleSetting, OrbitSetting, RadiusSetting, TargetSetting } from './grammar.js';
import { framingDistance, toViewer, viewerFrame, type CameraPose, type ViewerFrame } from './orbit.js';
import type { CameraLimits } from './orbit-camera.js';

/** The parsed camera attributes. */
export interface CameraSettings {
  readonly orbit: OrbitSetting;
  readonly minOrbit: OrbitSetting;
  readonly maxOrbit: OrbitSetting;
  readonly target: TargetSetting;
  readonly minTarget: TargetSetting;
  readonly maxTarget: TargetSetting;
  readonly fieldOfView: AngleSetting;
  readonly minFieldOfView: AngleSetting;
  readonly maxFieldOfView: AngleSetting;
  /**
   * Unit vector that points up in scene coordinates; undefined for the direction of the scene's file, or -y if it has
   * none.
   */
  readonly up: Vector3 | undefined;
  /** Whether the camera is orthographic. */
  readonly orthographic?: boolean;
}

/** Bounds of a scene in scene coordinates. */
export interface SceneBounds extends Bounds {
  /** Unit vector that points up; undefined if the scene's file does not declare one. */
  readonly up?: Vector3 | undefined;
  /** Limits for a camera that the scene's file recommends: they replace the automatic ones. */
  readonly orbit?: CloudHints['orbit'];
  /** Meters of a world unit; undefined if the scene's file does not declare it. */
  readonly metersPerUnit?: number | undefined;
}

/** Returns the rotation from scene coordinates to viewer space. */
export const frameOf = ({ up }: Pick<CameraSettings, 'up'>, bounds: Pick<SceneBounds, 'up'>): ViewerFrame =>
  viewerFrame(up ?? bounds.up ?? [0, -1, 0]);

const DEGREE = Math.PI / 180;
/** Values that replace `auto`; angles in radians. */
const AUTO = {
  phi: 75 * DEGREE,
  fieldOfView: 45 * DEGREE,
  minFieldOfView: 1 * DEGREE,
  maxFieldOfView: 160 * DEGREE,
  minPhi: 22.5 * DEGREE,
  maxPhi: 157.5 * DEGREE,
  minRadius: 0,
};
/** Minimum and maximum distance, as multiples of the framing distance. */
const [MIN_FRAMINGS, MAX_FRAMINGS] = [0.02, 5];

/** Returns a number or angle, or the automatic one. */
const given = (setting: AngleSetting, auto: number): number => (setting === 'auto' ? auto : setting);

function distance(setting: RadiusSetting, auto: number, framing: number): number {
  if (setting === 'auto') return auto;
  return 'meters' in setting ? setting.meters : setting.framings * framing;
}

/** Returns the pose for the attributes. `aspect` is width / height of the frame. */
export function poseOf(settings: CameraSettings, bounds: SceneBounds, aspect: number): CameraPose {
  const { minPhi, maxPhi, minRadius } = { ...AUTO, ...bounds.orbit };
  const fieldOfView = given(settings.fieldOfView, AUTO.fieldOfView);
  const framing = framingDistance(bounds.radius, fieldOfView, aspect);
  const frame = frameOf(settings, bounds);
  const center = toViewer(frame, bounds.center);
  const { theta, phi, radius } = settings.orbit;
  if (bounds.inside && [theta, phi, radius, ...settings.target].every((setting) => setting === 'auto')) {
    const { inside } = bounds;
    const [x, y, z] = toViewer(frame, inside.center);
    const [dx, , dz] = subtract(toViewer(frame, inside.toward), [x, y, z]);
    return { theta: Math.atan2(-dx, -dz), phi: Math.PI / 2, radius: inside.radius, x, y, z, fieldOfView };
  }
  const [x, y, z] = settings.target.map((setting, axis) => given(setting, center[axis]));
  return {
    theta: given(theta, 0),
    phi: given(phi, Math.min(maxPhi, Math.max(minPhi, AUTO.phi))),
    radius: distance(radius, Math.max(framing, Math.min(minRadius, MAX_FRAMINGS * framing)), framing),
    x,
    y,
    z,
    fieldOfView,
  };
}

/**
 * Returns the limits for the attributes. `auto` limits are extended to include the pose of the attributes, and `asked`,
 * a pose that a flight specifies.
 */
export function limitsOf(
  settings: CameraSettings,
  bounds: SceneBounds,
  aspect: number,
  asked?: CameraPose,
): CameraLimits {
  const { minOrbit, maxOrbit } = settings;
  const { minPhi, maxPhi, minRadius } = { ...AUTO, ...bounds.orbit };
  const pose = poseOf(settings, bounds, aspect);
  const [min, max] = [Math.min, Math.max].map(
    (choose) =>
      (auto: number, key: keyof CameraPose): number =>
        choose(auto, pose[key], (asked ?? pose)[key]),
  );
  const framing = framingDistance(bounds.radius, pose.fieldOfView, aspect);
  const place = (setting: TargetSetting, auto: number): Pick<CameraPose, 'x' | 'y' | 'z'> => {
    const [x, y, z] = setting.map((value) => given(value, auto));
    return { x, y, z };
  };
  return {
    min: {
      theta: given(minOrbit.theta, -Infinity),
      phi: Math.max(0, given(minOrbit.phi, min(minPhi, 'phi'))),
      radius: distance(minOrbit.radius, min(minRadius || MIN_FRAMINGS * framing, 'radius'), framing),
      ...place(settings.minTarget, -Infinity),
      fieldOfView: given(settings.minFieldOfView, min(AUTO.minFieldOfView, 'fieldOfView')),
    },
    max: {
      theta: given(maxOrbit.theta, Infinity),
      phi: Math.min(Math.PI, given(maxOrbit.phi, max(maxPhi, 'phi'))),
      radius: distance(maxOrbit.radius, max(MAX_FRAMINGS * framing, 'radius'), framing),
      ...place(settings.maxTarget, Infinity),
      fieldOfView: given(settings.maxFieldOfView, max(AUTO.maxFieldOfView, 'fieldOfView')),
    },
  };
}
