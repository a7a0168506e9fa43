import { GaussianSplatError, multiply, validateCamera, type Camera, type Vector3 } from '@gaussian-splat/core';
import { renderDepth, type DepthImage, type DepthRequest } from './render-depth.js';
import type { Viewpoint } from './viewpoint.js';

/**
 * A camera of OpenCV's fisheye model (Kannala and Brandt 2006), which needs no distortion for an equidistant lens. A
 * direction at the angle θ from the optical axis, and φ around it, is at the pixel (fx r cos φ + cx, fy r sin φ + cy)
 * with r = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).
 */
export interface FisheyeCamera extends Camera {
  /** k1, k2, k3 and k4: `D` of `cv2.fisheye`. */
  readonly fisheye: readonly number[];
}

/** A fisheye camera, and the options of {@link DepthRequest}. */
export interface FisheyeRequest extends DepthRequest {
  readonly camera: FisheyeCamera;
}

/** Pixels of a face for each pixel of the image, across and down. */
const OVERSAMPLING = 2;
/** Pixels beyond the edge of a face, for interpolation. */
const MARGIN = 2;
/** Step of the table of angles, radians. */
const STEP = 0.002;

/** Axes of the faces of a cube around the camera: right, down and forward, in the axes of the camera. */
const FACES: readonly (readonly [Vector3, Vector3, Vector3])[] = [
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]], // prettier-ignore
  [[0, 0, -1], [0, 1, 0], [1, 0, 0]], // prettier-ignore
  [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], // prettier-ignore
  [[1, 0, 0], [0, 0, -1], [0, 1, 0]], // prettier-ignore
  [[1, 0, 0], [0, 0, 1], [0, -1, 0]], // prettier-ignore
  [[-1, 0, 0], [0, 1, 0], [0, 0, -1]], // prettier-ignore
];

/**
 * Draws one image of a fisheye camera, with depth and identity: see {@link renderDepth}. The image is resampled from
 * those faces of a cube that it shows, drawn with twice its resolution. Splats are ordered by their distance from the
 * camera. Depths are distances along the ray of the pixel, because rays may point backwards; the nearest pixel of the
 * face provides them.
 * @throws GaussianSplatError `argument/camera` for coefficients that are not four finite numbers, and for parallel
 * rays; as {@link renderDepth} does.
 */
export async function renderFisheye(
  device: GPUDevice,
  viewpoint: Viewpoint,
  request: FisheyeRequest,
): Promise<DepthImage> {
  const { camera } = request;
  validateCamera(camera);
  requireFisheye(camera);
  const { width, height } = camera;
  const { directions, focal } = directionsOf(camera);
  const side = Math.min(2 * Math.ceil(focal + MARGIN), device.limits.maxTextureDimension2D);
  const lens = { width: side, height: side, cx: side / 2, cy: side / 2, fx: side / 2 - MARGIN, fy: side / 2 - MARGIN };
  const settings = { ...(request.settings ?? viewpoint.settings), order: 'distance' as const };
  const image = blank(width, height);
  // Rays at an edge belong to the first of its faces.
  const left = new Set(directions.keys());
  for (const axes of FACES) {
    const seen = pixelsOn(axes, directions).filter(({ pixel }) => left.delete(pixel));
    if (seen.length === 0) continue;
    const [right, down, forward] = axes;
    const turn = [...right, 0, ...down, 0, ...forward, 0, 0, 0, 0, 1];
    const worldToCamera = multiply(turn, camera.worldToCamera);
    const face = await renderDepth(device, viewpoint, {
      ...{ ...request, settings },
      camera: { ...camera, ...lens, worldToCamera },
    });
    image.owners = face.owners;
    for (const { pixel, x, y } of seen)
      resample(image, pixel, face, lens.fx * x + lens.cx, lens.fy * y + lens.cy, lens.fx);
  }
  return image;
}

type Writable = { -readonly [K in keyof DepthImage]: DepthImage[K] };

function blank(width: number, height: number): Writable {
  const [depth, expectedDepth, coverage] = [0, 1, 2].map(() => new Float32Array(width * height));
  const color = new Float32Array(4 * width * height);
  return { width, height, color, depth, expectedDepth, coverage, ids: new Uint32Array(width * height), owners: [] };
}

/** Writes a pixel from a position on a face: color and coverage interpolated, the rest from the nearest pixel. */
function resample(image: Writable, pixel: number, face: DepthImage, x: number, y: number, focal: number): void {
  const { width, height } = face;
  const [left, top] = [Math.floor(x - 0.5), Math.floor(y - 0.5)];
  const [across, down] = [x - 0.5 - left, y - 0.5 - top];
  for (const [column, row, weight] of [
    [left, top, (1 - across) * (1 - down)],
    [left + 1, top, across * (1 - down)],
    [left, top + 1, (1 - across) * down],
    [left + 1, top + 1, across * down],
  ]) {
    const from = Math.min(height - 1, Math.max(0, row)) * width + Math.min(width - 1, Math.max(0, column));
    for (let k = 0; k < 4; k++) image.color[4 * pixel + k] += weight * face.color[4 * from + k];
    image.coverage[pixel] += weight * face.coverage[from];
  }
  const [column, row] = [Math.min(width - 1, Math.floor(x)), Math.min(height - 1, Math.floor(y))];
  const nearest = row * width + column;
  const slant = Math.hypot(1, (column + 0.5 - width / 2) / focal, (row + 0.5 - height / 2) / focal);
  image.depth[pixel] = slant * face.depth[nearest];
  image.expectedDepth[pixel] = slant * face.expectedDepth[nearest];
  image.ids[pixel] = face.ids[nearest];
}

/** Pixels whose rays meet a face, with their positions on it: -1 to 1 across and down. */
function pixelsOn(
  [right, down, forward]: (typeof FACES)[number],
  directions: readonly (Vector3 | undefined)[],
): { readonly pixel: number; readonly x: number; readonly y: number }[] {
  return directions.flatMap((ray, pixel) => {
    if (ray === undefined) return [];
    const along = (axis: Vector3): number => axis[0] * ray[0] + axis[1] * ray[1] + axis[2] * ray[2];
    const [x, y, z] = [along(right), along(down), along(forward)];
    return z > 0 && Math.abs(x) <= z && Math.abs(y) <= z ? [{ pixel, x: x / z, y: y / z }] : [];
  });
}

/** Returns the direction of each pixel, undefined beyond the range of the lens, and the focal length of the faces. */
function directionsOf({ width, height, fx, fy, cx, cy, fisheye }: FisheyeCamera): {
  readonly directions: readonly (Vector3 | undefined)[];
  readonly focal: number;
} {
  // r(θ) up to its maximum or half a turn, in equal steps.
  const radii = [0];
  for (let angle = STEP; angle <= Math.PI; angle += STEP) {
    const radius = radiusAt(angle, fisheye);
    if (radius <= radii.at(-1)!) break;
    radii.push(radius);
  }
  let steepest = 1;
  const directions = Array.from({ length: width * height }, (_, pixel): Vector3 | undefined => {
    const [x, y] = [((pixel % width) + 0.5 - cx) / fx, (Math.floor(pixel / width) + 0.5 - cy) / fy];
    const radius = Math.hypot(x, y);
    const above = radii.findIndex((own) => own > radius);
    if (above < 0) return undefined;
    const slope = (radii[above] - radii[above - 1]) / STEP;
    steepest = Math.max(steepest, slope);
    // The inverse is nearly linear within a step: one step of Newton's method makes it exact.
    const guess = STEP * (above - 1) + (radius - radii[above - 1]) / slope;
    const angle = guess + (radius - radiusAt(guess, fisheye)) / slope;
    const sine = radius > 0 ? Math.sin(angle) / radius : 1;
    return [sine * x, sine * y, Math.cos(angle)];
  });
  return { directions, focal: OVERSAMPLING * Math.max(fx, fy) * steepest };
}

function radiusAt(angle: number, [k1, k2, k3, k4]: readonly number[]): number {
  const square = angle * angle;
  return angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))));
}

function requireFisheye({ fisheye, orthographic }: FisheyeCamera): void {
  const isFisheye = fisheye?.length === 4 && fisheye.every(Number.isFinite) && !orthographic;
  if (isFisheye) return;
  throw new GaussianSplatError('argument/camera', {
    where: 'camera.fisheye',
    expected: 'four finite coefficients k1, k2, k3, k4 and no parallel rays',
    found: JSON.stringify({ fisheye, orthographic }),
    remedy: 'give the coefficients D of cv2.fisheye, or [0, 0, 0, 0] for an equidistant lens',
  });
}
