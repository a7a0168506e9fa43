/**
 * Reads lists of views: in the page's own syntax, a trainer's `cameras.json`, or the settings of SuperSplat's viewer.
 */
import { fail, type CameraView } from './camera-view.js';

/** A view that visitors can select. */
export interface NamedView {
  readonly name: string;
  readonly view: CameraView;
}

/** View at a time of a path, in seconds. */
export interface Keyframe {
  readonly time: number;
  readonly view: CameraView;
}

export interface ViewList {
  readonly views: readonly NamedView[];
  /** Keyframes of a path in the file; empty if the path leads through the views. */
  readonly path: readonly Keyframe[];
}

const EXPECTED =
  'a list of views { name, orbit, target, fieldOfView }, the list of a cameras.json, or the settings of SuperSplat (version 1 or 2)';

/** Reads a list of views from parsed JSON or an equal object. @throws GaussianSplatError `argument/camera` */
export function readViews(json: unknown): ViewList {
  const list = isObject(json) && Array.isArray(json.views) ? json.views : json;
  if (Array.isArray(list)) return { views: list.map(readView), path: [] };
  if (isObject(list) && ['camera', 'cameras', 'animTracks', 'annotations'].some((key) => key in list))
    return readSuperSplat(list);
  throw fail('views', EXPECTED, json);
}

function readView(entry: unknown, index: number): NamedView {
  if (!isObject(entry)) throw fail(`views[${index}]`, EXPECTED, entry);
  const { name, img_name: image, id } = entry;
  const given = [name, image, id].find((value) => typeof value === 'string' || typeof value === 'number');
  return { name: String(given ?? index + 1), view: entry as CameraView };
}

/** Camera in SuperSplat's format: `fov` in degrees along the longer side, points in the space of its viewer. */
interface SuperSplatPose {
  readonly position: readonly number[];
  readonly target: readonly number[];
  readonly fov?: number;
}

function readSuperSplat(settings: Readonly<Record<string, unknown>>): ViewList {
  const { camera, cameras, annotations, animTracks } = settings as {
    camera?: Partial<SuperSplatPose>;
    cameras?: readonly { initial: SuperSplatPose }[];
    annotations?: readonly { title?: string; camera?: { initial: SuperSplatPose } }[];
    animTracks?: readonly SuperSplatTrack[];
  };
  const look = (pose: SuperSplatPose): CameraView => ({
    position: pose.position,
    lookAt: pose.target,
    space: 'supersplat',
    ...(pose.fov ? { fov: pose.fov } : {}),
  });
  const first = camera?.position && camera.target ? [{ initial: camera as SuperSplatPose }] : [];
  const starts = [...(cameras ?? []), ...first].map(({ initial }, i) => ({ name: `${i + 1}`, view: look(initial) }));
  const stops = (annotations ?? []).flatMap(({ title, camera: from }, i) =>
    from ? [{ name: String(title || i + 1), view: look(from.initial) }] : [],
  );
  return { views: [...starts, ...stops], path: readTrack(animTracks?.[0], camera?.fov, look) };
}

interface SuperSplatTrack {
  readonly frameRate?: number;
  readonly keyframes: {
    readonly times: readonly number[];
    readonly values: {
      readonly position: readonly number[];
      readonly target: readonly number[];
      readonly fov?: readonly number[];
    };
  };
}

function readTrack(
  track: SuperSplatTrack | undefined,
  fov: number | undefined,
  look: (pose: SuperSplatPose) => CameraView,
): Keyframe[] {
  if (track === undefined) return [];
  const { times, values } = track.keyframes;
  // Old files have no frame rate, and their times are seconds.
  const rate = track.frameRate || 1;
  return times.map((time, i) => ({
    time: time / rate,
    view: look({
      position: values.position.slice(3 * i, 3 * i + 3),
      target: values.target.slice(3 * i, 3 * i + 3),
      fov: values.fov?.[i] ?? fov,
    }),
  }));
}

const isObject = (value: unknown): value is Readonly<Record<string, unknown>> =>
  typeof value === 'object' && value !== null && !Array.isArray(value);
