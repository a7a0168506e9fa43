/**
 * Camera paths: through a list of views, along the keyframes of a file, or once around the target. Independent of the
 * DOM.
 */
import type { CameraPose } from './orbit.js';
import { poseOf } from './settings.js';
import { poseOfView, type ViewContext } from './camera-view.js';
import { pathThrough } from './path.js';
import type { ViewList } from './read-views.js';

/** Seconds from one view of a list to the next if the file declares no times. */
const PART_SECONDS = 3;
/** Duration of one turn, seconds. */
const TURN_SECONDS = 8;

/** Name of a camera path: through the views of the list, or once around the target. */
export type PathName = 'views' | 'turntable';

export interface CameraPath {
  /** Duration of the path. */
  readonly seconds: number;
  /** Whether the path ends where it begins. */
  readonly isClosed: boolean;
  /** Returns the pose at a fraction of the path, 0..1. */
  at(share: number): CameraPose;
}

/**
 * Returns the path along the keyframes of a list, or through its views if it has none; null for an empty list. Parts
 * that a view omits have the values of the attributes, not those of the camera, because the camera moves along this
 * path.
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

/** Returns one turn around the target of a pose, in the direction of `auto-rotate`. */
export const turntable = (pose: CameraPose): CameraPath => ({
  seconds: TURN_SECONDS,
  isClosed: true,
  at: (share) => ({ ...pose, theta: pose.theta + 2 * Math.PI * share }),
});

/**
 * Returns the fraction of the path at each frame: from 0 to 1. For a closed path, the last frame is one step before 1,
 * because 1 would repeat the first frame.
 */
export function frameShares(frames: number, { isClosed }: Pick<CameraPath, 'isClosed'>): number[] {
  const steps = Math.max(1, isClosed ? frames : frames - 1);
  return Array.from({ length: frames }, (_, frame) => frame / steps);
}

/** Returns the number of frames of a video, at least 1. `frameRate` is frames per second. */
export const frameCount = (seconds: number, frameRate: number): number => Math.max(1, Math.round(seconds * frameRate));
