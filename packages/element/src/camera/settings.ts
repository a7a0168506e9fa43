/** Converts camera attributes for a given scene and frame: settings with `auto` and `%` become a pose. */
import type { Bounds, Vector3 } from '@gaussian-splat/core';
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
  /** Unit vector that points up in scene coordinates; undefined for that of the scene, else -y. */
  readonly up: Vector3 | undefined;
  /** Rays are parallel. */
  readonly orthographic?: boolean;
}

/** Bounds of a scene, in its own coordinates. */
export interface SceneBounds extends Bounds {
  /** Unit vector that points up, if the scene declares one. */
  readonly up?: Vector3 | undefined;
}

/** Rotation from scene coordinates to viewer space. */
export const frameOf = ({ up }: Pick<CameraSettings, 'up'>, bounds: Pick<SceneBounds, 'up'>): ViewerFrame =>
  viewerFrame(up ?? bounds.up ?? [0, -1, 0]);

const DEGREE = Math.PI / 180;
/** Values of `auto`. */
const AUTO = {
  theta: 0,
  phi: 75 * DEGREE,
  fieldOfView: 45 * DEGREE,
  minFieldOfView: 1 * DEGREE,
  maxFieldOfView: 160 * DEGREE,
  minPhi: 22.5 * DEGREE,
  maxPhi: 157.5 * DEGREE,
  /** Nearest and farthest distance, as multiples of the framing distance. */
  minFramings: 0.02,
  maxFramings: 5,
};

const angle = (setting: AngleSetting, auto: number): number => (setting === 'auto' ? auto : setting);

function distance(setting: RadiusSetting, auto: number, framing: number): number {
  if (setting === 'auto') return auto;
  return 'meters' in setting ? setting.meters : setting.framings * framing;
}

/** Returns the pose for the attributes. `aspect` is width / height of the frame. */
export function poseOf(settings: CameraSettings, bounds: SceneBounds, aspect: number): CameraPose {
  const fieldOfView = angle(settings.fieldOfView, AUTO.fieldOfView);
  const framing = framingDistance(bounds.radius, fieldOfView, aspect);
  const center = toViewer(frameOf(settings, bounds), bounds.center);
  const [x, y, z] = settings.target.map((setting, axis) => (setting === 'auto' ? center[axis] : setting));
  return {
    theta: angle(settings.orbit.theta, AUTO.theta),
    phi: angle(settings.orbit.phi, AUTO.phi),
    radius: distance(settings.orbit.radius, framing, framing),
    x,
    y,
    z,
    fieldOfView,
  };
}

/**
 * Returns the limits for the attributes. An automatic limit is extended for a pose that the attributes or a flight
 * specify explicitly.
 */
export function limitsOf(
  settings: CameraSettings,
  bounds: SceneBounds,
  aspect: number,
  asked?: CameraPose,
): CameraLimits {
  const { minOrbit, maxOrbit } = settings;
  const pose = poseOf(settings, bounds, aspect);
  const poses = [pose, asked ?? pose];
  const min = (auto: number, key: keyof CameraPose): number => Math.min(auto, ...poses.map((each) => each[key]));
  const max = (auto: number, key: keyof CameraPose): number => Math.max(auto, ...poses.map((each) => each[key]));
  const framing = framingDistance(bounds.radius, pose.fieldOfView, aspect);
  const place = (setting: TargetSetting, auto: number): Pick<CameraPose, 'x' | 'y' | 'z'> => {
    const [x, y, z] = setting.map((value) => (value === 'auto' ? auto : value));
    return { x, y, z };
  };
  return {
    min: {
      theta: angle(minOrbit.theta, -Infinity),
      phi: Math.max(0, angle(minOrbit.phi, min(AUTO.minPhi, 'phi'))),
      radius: distance(minOrbit.radius, min(AUTO.minFramings * framing, 'radius'), framing),
      ...place(settings.minTarget, -Infinity),
      fieldOfView: angle(settings.minFieldOfView, min(AUTO.minFieldOfView, 'fieldOfView')),
    },
    max: {
      theta: angle(maxOrbit.theta, Infinity),
      phi: Math.min(Math.PI, angle(maxOrbit.phi, max(AUTO.maxPhi, 'phi'))),
      radius: distance(maxOrbit.radius, max(AUTO.maxFramings * framing, 'radius'), framing),
      ...place(settings.maxTarget, Infinity),
      fieldOfView: angle(settings.maxFieldOfView, max(AUTO.maxFieldOfView, 'fieldOfView')),
    },
  };
}
