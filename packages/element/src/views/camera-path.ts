/** Camera paths: through a list of views, along the keyframes of a file, or once around the target. Pure. */
import type { CameraPose } from '../camera/orbit.js';
import { poseOf } from '../camera/settings.js';
import { poseOfView, type ViewContext } from './camera-view.js';
import { pathThrough } from './path.js';
import type { ViewList } from './read-views.js';

/** Seconds from one view of a list to the next, where its file has no times. */
const PART_SECONDS = 3;
/** Seconds of one turn. */
const TURN_SECONDS = 8;

/** Path of the camera: through the views of the list, or once around its target. */
export type PathName = 'views' | 'turntable';

export interface CameraPath {
  /** Length. */
  readonly seconds: number;
  /** True for a path that ends where it begins. */
  readonly isClosed: boolean;
  /** The pose at a fraction of the path, 0..1. */
  at(share: number): CameraPose;
}

/**
 * The path of a list: its keyframes if it has any, else through its views. null for an empty list. What views leave out is that of the attributes, wherever the camera is now: it moves along this
 * very path.
 */
export function pathOfList({ views, path }: ViewList, place: Omit<ViewContext, 'from'>): CameraPath | null {
  const context = { ...place, from: poseOf(place.settings, place.bounds, place.aspect) };
  const stops = path.length > 0 ? path : views.map(({ view }, i) => ({ time: i * PART_SECONDS, view }));
  if (stops.length === 0) return null;
  const times = stops.map(({ time }) => time);
  const [first, seconds] = [times[0], times[times.length - 1] - times[0]];
  const along = pathThrough(
    stops.map(({ view }) => poseOfView(view, context)),
    times,
  );
  return { seconds, isClosed: false, at: (share) => along(first + share * seconds) };
}

/** One turn around the target of a pose, in the direction of `auto-rotate`. */
export const turntable = (pose: CameraPose): CameraPath => ({
  seconds: TURN_SECONDS,
  isClosed: true,
  at: (share) => ({ ...pose, theta: pose.theta + 2 * Math.PI * share }),
});

/** Fractions of a path at its frames: from 0 to 1, or, if it is closed, to the frame before its beginning. */
export function frameShares(frames: number, { isClosed }: Pick<CameraPath, 'isClosed'>): number[] {
  const steps = Math.max(1, isClosed ? frames : frames - 1);
  return Array.from({ length: frames }, (_, frame) => frame / steps);
}

/** Frames of a video, 1 or more. */
export const frameCount = (seconds: number, frameRate: number): number => Math.max(1, Math.round(seconds * frameRate));
