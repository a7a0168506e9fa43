import { cross, DEFAULT_FAR, eyeOf, lookAt, type Bounds, type Camera, type Vector3 } from '@gaussian-splat/core';

export interface ViewOptions {
  readonly width?: number;
  readonly height?: number;
  /** Vertical field of view, radians. */
  readonly fovYRadians?: number;
  /** Another seed gives a disjoint set of views. */
  readonly seed?: number;
}

/** Distances from the center of the subject, in its radii: from close to the whole subject in view. */
const DISTANCES = [1.5, 1.9, 2.4, 3.2];
/** Height of the eye above the subject, radians: from slightly below to well above. */
const ELEVATIONS: readonly [number, number] = [-0.35, 1.1];

/**
 * Views around a subject for scenes without cameras: evenly spaced around it, at several heights and distances, looking
 * at points near its center. Up is -y, as in captures.
 */
export function viewsAround(bounds: Bounds, count: number, options: ViewOptions = {}): Camera[] {
  const { width = 480, height = 270, fovYRadians = 0.7, seed = 0 } = options;
  const { center, radius } = bounds;
  const f = height / (2 * Math.tan(fovYRadians / 2));
  return Array.from({ length: count }, (_, k) => {
    // Additive sequences with irrational steps: no two sets of views share one, and every set covers the whole range.
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

/** Distances of {@link viewsFromEverywhere}, in radii of the subject: every fifth from within it. */
const EVERYWHERE = [...DISTANCES, 0.6];

/**
 * Views of a subject from all directions, including from below and from within: parts that none of these show hardly
 * matter.
 */
export function viewsFromEverywhere(bounds: Bounds, count: number, options: ViewOptions = {}): Camera[] {
  const { center, radius } = bounds;
  return viewsAround(bounds, count, options).map((view, k) => {
    const azimuth = 2 * Math.PI * ((0.6180339887 * (k + 0.5)) % 1);
    const height = 2 * ((0.7548776662 * (k + 0.5)) % 1) - 1;
    const distance = radius * EVERYWHERE[k % EVERYWHERE.length];
    const across = Math.sqrt(1 - height * height);
    const direction = [across * Math.sin(azimuth), -height, -across * Math.cos(azimuth)];
    const eye = center.map((value, axis) => value + distance * direction[axis]) as [number, number, number];
    return { ...view, worldToCamera: lookAt(eye, center, [0, -1, 0]) };
  });
}

/**
 * Distances of visitors' views, in radii: from within the subject, which enlarges its splats the most, to the whole
 * subject in view.
 */
const VISITED_DISTANCES = [0.5, 0.75, 1.1, 1.6, 2.3, 3.2];
/** Range of the element's cameras above and below a subject, radians. */
const VISITED_ELEVATION = 1.17;

/**
 * Views that visitors may take of a subject: nearer than in captures, and also from below; looking at points near its
 * center.
 */
function viewsOfVisitors(bounds: Bounds, count: number, options: ViewOptions): Camera[] {
  const { center, radius } = bounds;
  return viewsAround(bounds, count, options).map((view, k) => {
    const at = (step: number): number => ((k + 0.5 + 97 * (options.seed ?? 0)) * step) % 1;
    const azimuth = 2 * Math.PI * at(0.6180339887);
    const height = Math.sin(VISITED_ELEVATION) * (2 * at(0.7548776662) - 1);
    const distance = radius * VISITED_DISTANCES[(k + (options.seed ?? 0)) % VISITED_DISTANCES.length];
    const across = Math.sqrt(1 - height * height);
    const direction = [across * Math.sin(azimuth), -height, -across * Math.cos(azimuth)];
    const eye = center.map((value, axis) => value + distance * direction[axis]) as [number, number, number];
    const aside = [0.5698402909, 0.3247179572, 0.4142135623].map((step) => 0.3 * radius * (at(step) - 0.5));
    const target = center.map((value, axis) => value + aside[axis]) as [number, number, number];
    return { ...view, worldToCamera: lookAt(eye, target, [0, -1, 0]) };
  });
}

/** Pixels of the frames on visitors' screens. */
const FULL_PIXELS = 1920 * 1080;
/** Errors are measured in crops of this many pixels: a whole frame takes nine times as long and gives the same result. */
const EXCERPT_PIXELS = 640 * 360;

/** Frame size for measuring errors of a view: at least the pixels of visitors' screens. */
function fullSizeOf({ width, height }: Pick<Camera, 'width' | 'height'>): { width: number; height: number } {
  const share = Math.max(1, Math.sqrt(FULL_PIXELS / (width * height)));
  return { width: Math.round(share * width), height: Math.round(share * height) };
}

/**
 * Crops of views at the resolution of visitors' screens, because the cost of a cut depends on the size of pixels,
 * especially for small splats.
 */
export function excerptsOf(views: readonly Camera[]): Camera[] {
  return views.map((view, k) => {
    const full = fullSizeOf(view);
    const [x, y] = [full.width / view.width, full.height / view.height];
    const share = Math.min(1, Math.sqrt(EXCERPT_PIXELS / (full.width * full.height)));
    const [width, height] = [full.width, full.height].map((side) => Math.round(share * side));
    const at = (step: number): number => ((k + 0.5) * step) % 1;
    // Near the center more often than at the edges, which subjects may not reach.
    const [left, top] = [0.2 + 0.6 * at(0.5545497), 0.2 + 0.6 * at(0.3085152)];
    return {
      ...view,
      ...{ width, height, fx: x * view.fx, fy: y * view.fy },
      cx: x * view.cx - Math.round(left * (full.width - width)),
      cy: y * view.cy - Math.round(top * (full.height - height)),
    };
  });
}

/** Views divided by purpose. */
export interface ViewSplit {
  /** Views for scoring the contribution of splats. */
  readonly scored: readonly Camera[];
  /** Views for finding the size of the cut. */
  readonly searched: readonly Camera[];
  /** Views used only for measuring the result. */
  readonly heldOut: readonly Camera[];
}

/**
 * Views halfway between each camera and its nearest neighbor, as seen by visitors who move away from the capture
 * positions. Scores from few cameras would overfit their exact positions. Cameras in opposite directions, as in a
 * divided panorama, give none.
 * @param all All cameras that may be the neighbor; default: the same.
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

/** Mean axes that are shorter, or nearly parallel, define no orientation. */
const MIN_AXIS = 1e-3;

/** A pose between two: the eye in the middle, the axes averaged and orthogonalized; undefined if they are degenerate. */
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

/** Divides views: of ten consecutive ones, one is for the search, two are held out, and the rest are for scoring. */
export function splitViews(views: readonly Camera[]): ViewSplit {
  const of = (...places: number[]): Camera[] => views.filter((_, k) => places.includes(k % 10));
  return { scored: of(0, 1, 3, 4, 5, 6, 8), searched: of(2), heldOut: of(7, 9) };
}

export interface DealtViewOptions extends Omit<ViewOptions, 'seed'> {
  /** Number of scoring views; default 216. More views give better colors at lower degrees. */
  readonly scored?: number;
}

/** Seeds of the three kinds, far enough apart that scoring views never coincide with the others. */
const [SEARCHED_SEED, HELD_OUT_SEED, SCORED_SEED] = [1, 2, 10];

/**
 * Four views at each distance: with only six views the result depended on the selection by a decibel or two
 * (packages/economise/README.md).
 */
const HELD_OUT = 24;

/** Views around a subject, all of one size: 216 for scoring, 8 for the search, 24 held out. */
export function viewSplitAround(bounds: Bounds, { scored = 216, ...options }: DealtViewOptions = {}): ViewSplit {
  return dealt(scored, (count, seed) => viewsAround(bounds, count, { ...options, seed }));
}

/**
 * Views that visitors may take of a scene without cameras: 0.5 to 3.2 radii from its center, up to 67° above and below
 * it. Errors are measured in crops of frames of 1920 x 1080.
 * @param scored Number of scoring views.
 */
export function dealtViewsOfVisitors(bounds: Bounds, scored = 216): ViewSplit {
  const { searched, heldOut, ...rest } = dealt(scored, (count, seed) => viewsOfVisitors(bounds, count, { seed }));
  return { ...rest, searched: excerptsOf(searched), heldOut: excerptsOf(heldOut) };
}

const dealt = (scored: number, viewsOf: (count: number, seed: number) => Camera[]): ViewSplit => ({
  scored: viewsOf(scored, SCORED_SEED),
  searched: viewsOf(8, SEARCHED_SEED),
  heldOut: viewsOf(HELD_OUT, HELD_OUT_SEED),
});

/** Minimum pixels of scoring views, because most splats are smaller than a pixel in smaller views, and seem unneeded. */
const MIN_SCORED_PIXELS = 480 * 270;

/**
 * Divides a scene's own views ({@link splitViews}). Views between neighbors are added for scoring and for measuring
 * errors, in crops of frames at the resolution of visitors' screens.
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
