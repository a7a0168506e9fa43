import {
  cross,
  DEFAULT_FAR,
  eyeOf,
  lookAt,
  multiply,
  type Bounds,
  type Camera,
  type Vector3,
} from '@gaussian-splat/core';
import { uprightRotation } from '@gaussian-splat/formats';

export interface ViewOptions {
  readonly width?: number;
  readonly height?: number;
  /** Vertical field of view in radians. */
  readonly fovYRadians?: number;
  /** Seed of the views. Different seeds give disjoint sets of views. */
  readonly seed?: number;
}

/** Distances of the eye from the center of the subject, in radii of the subject. */
const DISTANCES = [1.5, 1.9, 2.4, 3.2];
/** Minimum and maximum elevation of the eye above the subject, in radians. */
const ELEVATIONS: readonly [number, number] = [-0.35, 1.1];

/**
 * Returns views of a subject for scenes without cameras. Views are evenly spaced around the subject, at several heights
 * and distances, and look at points near its center. Up is -y, as in captures.
 */
export function viewsAround(bounds: Bounds, count: number, options: ViewOptions = {}): Camera[] {
  const { width = 480, height = 270, fovYRadians = 0.7, seed = 0 } = options;
  const { center, radius } = bounds;
  const f = height / (2 * Math.tan(fovYRadians / 2));
  return Array.from({ length: count }, (_, k) => {
    // An additive sequence with an irrational step covers the whole range evenly, and does not repeat for other seeds.
    const at = (step: number): number => ((k + 0.5 + 97 * seed) * step) % 1;
    const azimuth = 2 * Math.PI * at(0.6180339887);
    const elevation = ELEVATIONS[0] + (ELEVATIONS[1] - ELEVATIONS[0]) * at(0.7548776662);
    const distance = radius * DISTANCES[(k + seed) % DISTANCES.length];
    const eye: Vector3 = [
      center[0] + distance * Math.cos(elevation) * Math.sin(azimuth),
      center[1] - distance * Math.sin(elevation),
      center[2] - distance * Math.cos(elevation) * Math.cos(azimuth),
    ];
    const aside = (step: number): number => 0.3 * radius * (at(step) - 0.5);
    const target: Vector3 = [
      center[0] + aside(0.5698402909),
      center[1] + aside(0.3247179572),
      center[2] + aside(0.4142135623),
    ];
    return {
      ...{ width, height, fx: f, fy: f, cx: width / 2, cy: height / 2 },
      worldToCamera: lookAt(eye, target, [0, -1, 0]),
      near: radius / 100,
      far: DEFAULT_FAR,
    };
  });
}

/** Distances of {@link viewsFromEverywhere} in radii of the subject. Every fifth eye is within the subject. */
const EVERYWHERE = [...DISTANCES, 0.6];

/**
 * Returns views of a subject from all directions, including from below and from within. Splats that none of these views
 * shows are considered unimportant.
 */
export function viewsFromEverywhere(bounds: Bounds, count: number): Camera[] {
  return viewsAround(bounds, count).map((view, k) => {
    const height = 2 * ((0.7548776662 * (k + 0.5)) % 1) - 1;
    const eye = eyeFrom(bounds, (0.6180339887 * (k + 0.5)) % 1, height, EVERYWHERE[k % EVERYWHERE.length]);
    return { ...view, worldToCamera: lookAt(eye, bounds.center, [0, -1, 0]) };
  });
}

/**
 * Returns a point around the center of a subject.
 * @param turn Azimuth as a fraction of a turn.
 * @param height Sine of the elevation.
 * @param distance Distance in radii.
 */
function eyeFrom({ center, radius }: Bounds, turn: number, height: number, distance: number): Vector3 {
  const azimuth = 2 * Math.PI * turn;
  const across = Math.sqrt(1 - height * height);
  const direction = [across * Math.sin(azimuth), -height, -across * Math.cos(azimuth)];
  return center.map((value, axis) => value + radius * distance * direction[axis]) as unknown as Vector3;
}

/**
 * Distances of visitors' views in radii of the subject. The smallest ones, within the subject, enlarge splats the most.
 */
const VISITED_DISTANCES = [0.5, 0.75, 1.1, 1.6, 2.3, 3.2];
/** Maximum elevation of the element's camera above and below a subject, in radians. */
const VISITED_ELEVATION = 1.17;

/**
 * Returns views that visitors may take of a subject. These are nearer than captures, and also from below, and look at
 * points near its center.
 */
function viewsOfVisitors(bounds: Bounds, count: number, options: ViewOptions): Camera[] {
  const { center, radius } = bounds;
  return viewsAround(bounds, count, options).map((view, k) => {
    const at = (step: number): number => ((k + 0.5 + 97 * (options.seed ?? 0)) * step) % 1;
    const height = Math.sin(VISITED_ELEVATION) * (2 * at(0.7548776662) - 1);
    const distance = VISITED_DISTANCES[(k + (options.seed ?? 0)) % VISITED_DISTANCES.length];
    const eye = eyeFrom(bounds, at(0.6180339887), height, distance);
    const aside = [0.5698402909, 0.3247179572, 0.4142135623].map((step) => 0.3 * radius * (at(step) - 0.5));
    const target = center.map((value, axis) => value + aside[axis]) as [number, number, number];
    return { ...view, worldToCamera: lookAt(eye, target, [0, -1, 0]) };
  });
}

/** Number of pixels of a frame on visitors' screens. */
const FULL_PIXELS = 1920 * 1080;
/** Number of pixels of the crops that measure errors. Whole frames take nine times as long, with the same result. */
const EXCERPT_PIXELS = 640 * 360;

/** Returns the size of a view in pixels, enlarged to at least {@link FULL_PIXELS}. */
function fullSizeOf({ width, height }: Pick<Camera, 'width' | 'height'>): { width: number; height: number } {
  const share = Math.max(1, Math.sqrt(FULL_PIXELS / (width * height)));
  return { width: Math.round(share * width), height: Math.round(share * height) };
}

/**
 * Returns a crop of each view at the resolution of visitors' screens. The error of a cut depends on the size of pixels,
 * especially for small splats.
 */
export function excerptsOf(views: readonly Camera[]): Camera[] {
  return views.map((view, k) => {
    const full = fullSizeOf(view);
    const [x, y] = [full.width / view.width, full.height / view.height];
    const share = Math.min(1, Math.sqrt(EXCERPT_PIXELS / (full.width * full.height)));
    const [width, height] = [full.width, full.height].map((side) => Math.round(share * side));
    const at = (step: number): number => ((k + 0.5) * step) % 1;
    // Crops are nearer to the center than to the edges, which the subject may not cover.
    const [left, top] = [0.2 + 0.6 * at(0.5545497), 0.2 + 0.6 * at(0.3085152)];
    return {
      ...view,
      ...{ width, height, fx: x * view.fx, fy: y * view.fy },
      cx: x * view.cx - Math.round(left * (full.width - width)),
      cy: y * view.cy - Math.round(top * (full.height - height)),
    };
  });
}

/** Views of a scene, divided by their purpose. */
export interface ViewSplit {
  /** Views for scoring the contribution of splats. */
  readonly scored: readonly Camera[];
  /** Views that find the size of the cut. */
  readonly searched: readonly Camera[];
  /** Views that only measure the result. */
  readonly heldOut: readonly Camera[];
}

/**
 * Returns a view halfway between each camera and its nearest neighbor. Visitors see such views, and scores from only a few
 * cameras would overfit the positions of these cameras. Cameras in opposite directions, as in a divided panorama, give no
 * view.
 * @param all All cameras that may be the neighbor; default `views`.
 */
export function viewsBetween(views: readonly Camera[], all: readonly Camera[] = views): Camera[] {
  const eyes = all.map(({ worldToCamera }) => eyeOf(worldToCamera));
  const pairs = new Map<string, [Camera, Camera]>();
  for (const view of views) {
    const own = eyeOf(view.worldToCamera);
    const distances = eyes.map((eye, other) =>
      all[other] === view ? Infinity : Math.hypot(...eye.map((value, axis) => value - own[axis])),
    );
    const nearest = distances.indexOf(Math.min(...distances));
    const key = [all.indexOf(view), nearest].sort((a, b) => a - b).join();
    if (Number.isFinite(distances[nearest]) && !pairs.has(key)) pairs.set(key, [view, all[nearest]]);
  }
  return [...pairs.values()].flatMap(([a, b]) => {
    const worldToCamera = halfway(a, b);
    return worldToCamera ? [{ ...a, worldToCamera }] : [];
  });
}

/** Minimum length of the cross product of mean axes. Shorter or nearly parallel axes define no orientation. */
const MIN_AXIS = 1e-3;

/** Returns the pose between two cameras: mean eye, and mean axes orthogonalized. Undefined if the axes are degenerate. */
function halfway(a: Camera, b: Camera): Camera['worldToCamera'] | undefined {
  const [eyeA, eyeB] = [eyeOf(a.worldToCamera), eyeOf(b.worldToCamera)];
  const eye = eyeA.map((value, axis) => (value + eyeB[axis]) / 2) as [number, number, number];
  const axis = (row: number): Vector3 =>
    [0, 1, 2].map((k) => a.worldToCamera[4 * row + k] + b.worldToCamera[4 * row + k]) as [number, number, number];
  const [down, forward] = [axis(1), axis(2)];
  if (Math.hypot(...cross(down, forward)) < MIN_AXIS) return undefined;
  const target = eye.map((value, k) => value + forward[k]) as [number, number, number];
  return lookAt(eye, target, [-down[0], -down[1], -down[2]]);
}

/** Divides views. Of ten consecutive views, one is for the search, two are held out, and seven are for scoring. */
export function splitViews(views: readonly Camera[]): ViewSplit {
  const of = (...places: number[]): Camera[] => views.filter((_, k) => places.includes(k % 10));
  return { scored: of(0, 1, 3, 4, 5, 6, 8), searched: of(2), heldOut: of(7, 9) };
}

export interface DealtViewOptions extends Omit<ViewOptions, 'seed'> {
  /** Number of scoring views; default 216. More views give better colors at lower degrees. */
  readonly scored?: number;
}

/** Seeds of the three kinds of views, chosen so that scoring views never coincide with others. */
const [SEARCHED_SEED, HELD_OUT_SEED, SCORED_SEED] = [1, 2, 10];

/**
 * Number of held-out views, several at each distance. With only six views, the result depends on their selection by 1 to 2
 * dB (packages/optimize/README.md).
 */
const HELD_OUT = 24;

/** Returns views around a subject, all of the same size: 216 for scoring by default, 8 for the search, 24 held out. */
export function viewSplitAround(bounds: Bounds, { scored = 216, ...options }: DealtViewOptions = {}): ViewSplit {
  return dealt(scored, (count, seed) => viewsAround(bounds, count, { ...options, seed }));
}

/**
 * Returns views that visitors may take of a scene without cameras. Their distance from its center is 0.5 to 3.2 radii, and
 * their elevation -67° to 67°. Views that measure errors are crops of frames of 1920 x 1080 pixels.
 * @param scored Number of scoring views; default 216.
 * @param up Unit direction up of the scene; default (0, -1, 0).
 */
export function dealtViewsOfVisitors(bounds: Bounds, scored = 216, up?: Vector3): ViewSplit {
  const rotation = uprightRotation({ hints: { up } }) ?? [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const [a, b, c, d, e, f, g, h, i] = rotation;
  const center = [0, 3, 6].map((row) => bounds.center.reduce((sum, x, k) => sum + rotation[row + k] * x, 0));
  const standing = { ...bounds, center: center as unknown as Vector3 };
  const toStanding = [a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1] as const;
  const viewsOf = (count: number, seed: number): Camera[] =>
    viewsOfVisitors(standing, count, { seed }).map((view) => {
      return { ...view, worldToCamera: multiply(view.worldToCamera, toStanding) };
    });
  const { searched, heldOut, ...rest } = dealt(scored, viewsOf);
  return { ...rest, searched: excerptsOf(searched), heldOut: excerptsOf(heldOut) };
}

const dealt = (scored: number, viewsOf: (count: number, seed: number) => Camera[]): ViewSplit => ({
  scored: viewsOf(scored, SCORED_SEED),
  searched: viewsOf(8, SEARCHED_SEED),
  heldOut: viewsOf(HELD_OUT, HELD_OUT_SEED),
});

/** Minimum number of pixels of scoring views. In smaller views, splats smaller than a pixel would seem unimportant. */
const MIN_SCORED_PIXELS = 480 * 270;

/**
 * Divides the views of a scene's own cameras by {@link splitViews}, and adds views between neighbors. Views that measure
 * errors are crops at the resolution of visitors' screens.
 */
export function dealOwnViews(views: readonly Camera[]): ViewSplit {
  const { scored, searched, heldOut } = splitViews(views);
  const judged = (own: readonly Camera[]): Camera[] => excerptsOf([...own, ...viewsBetween(own, views)]);
  return {
    scored: [...scored, ...viewsBetween(scored)].map((view) => lowerBound(view, MIN_SCORED_PIXELS)),
    searched: judged(searched),
    heldOut: judged(heldOut),
  };
}

function lowerBound(view: Camera, pixels: number): Camera {
  const share = Math.sqrt(pixels / (view.width * view.height));
  if (share <= 1) return view;
  const [width, height] = [view.width, view.height].map((side) => Math.round(share * side));
  const [x, y] = [width / view.width, height / view.height];
  return { ...view, width, height, fx: x * view.fx, fy: y * view.fy, cx: x * view.cx, cy: y * view.cy };
}
