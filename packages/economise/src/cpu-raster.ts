import { shCoefficientCount, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { eyeOf, shBasis } from './colour.js';
import type { Image, Painter } from './measure.js';
import type { ContributionScorer } from './scorer.js';

/** Screen-space dilation of 3D Gaussian Splatting, px². */
const DILATION = 0.3;
const ALPHA_MIN = 1 / 255;
const ALPHA_MAX = 0.99;
/** Behind so much nothing more is seen. */
const OPAQUE = 1e-4;
const JACOBIAN_MARGIN = 0.3;

/** Splats on the screen, one array for each quantity. */
interface Projected {
  readonly count: number;
  readonly source: Uint32Array;
  readonly depths: Float32Array;
  /** [count, 6]: centre x and y, conic xx, xy, yy, opacity. */
  readonly ellipses: Float32Array;
  /** [count, 2]: half the size of the box in which alpha reaches 1/255. */
  readonly extents: Float32Array;
}

/**
 * A scorer that blends on the CPU, front to back, by the rules of the renderer: for tools where there is no GPU, and the one whose
 * figures others are held against.
 */
export function cpuScorer(cloud: GaussianCloud): ContributionScorer {
  const roots = factors(cloud);
  const peak = new Float32Array(cloud.count);
  const energy = new Float32Array(cloud.count);
  return (camera) => {
    peak.fill(0);
    energy.fill(0);
    const pixels = camera.width * camera.height;
    blend(project(cloud, roots, camera), camera, (source, most, squares) => {
      peak[source] = most;
      energy[source] = squares / pixels;
    });
    return { peak, energy };
  };
}

/** Draws images by the same code: where many small ones are wanted, it beats a GPU that is none. */
export const cpuPainter: Painter = {
  draw: async (cloud, views) => {
    const roots = factors(cloud);
    return views.map((camera) => {
      const projected = project(cloud, roots, camera);
      const image: Image = new Float32Array(4 * camera.width * camera.height);
      blend(projected, camera, () => undefined, { image, colours: coloursOf(cloud, projected, camera) });
      return image;
    });
  },
};

/** Colours of the splats on the screen, [count, 3]; negative ones are black, as in the renderer. */
function coloursOf(cloud: GaussianCloud, { count, source }: Projected, camera: Camera): Float32Array {
  const { positions, origin, sh, shDegree } = cloud;
  const numbers = shCoefficientCount(shDegree);
  const basis = new Float64Array(16);
  const eye = eyeOf(camera);
  const colours = new Float32Array(3 * count);
  for (let k = 0; k < count; k++) {
    const i = source[k];
    const x = positions[3 * i] + origin[0] - eye[0];
    const y = positions[3 * i + 1] + origin[1] - eye[1];
    const z = positions[3 * i + 2] + origin[2] - eye[2];
    const norm = 1 / Math.sqrt(x * x + y * y + z * z);
    shBasis(shDegree, x * norm, y * norm, z * norm, basis);
    for (let channel = 0; channel < 3; channel++) {
      let value = 0.5;
      for (let c = 0; c < numbers; c++) value += basis[c] * sh[3 * (numbers * i + c) + channel];
      colours[3 * k + channel] = Math.max(0, value);
    }
  }
  return colours;
}

/** R·S of every splat, [N, 9], rows outermost. */
function factors({ count, rotations, scales }: GaussianCloud): Float32Array {
  const out = new Float32Array(9 * count);
  for (let i = 0; i < count; i++) {
    const [w, x, y, z] = [rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]];
    const [a, b, c] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
    const at = 9 * i;
    out[at] = (1 - 2 * (y * y + z * z)) * a;
    out[at + 1] = 2 * (x * y - w * z) * b;
    out[at + 2] = 2 * (x * z + w * y) * c;
    out[at + 3] = 2 * (x * y + w * z) * a;
    out[at + 4] = (1 - 2 * (x * x + z * z)) * b;
    out[at + 5] = 2 * (y * z - w * x) * c;
    out[at + 6] = 2 * (x * z - w * y) * a;
    out[at + 7] = 2 * (y * z + w * x) * b;
    out[at + 8] = (1 - 2 * (x * x + y * y)) * c;
  }
  return out;
}

function project(cloud: GaussianCloud, roots: Float32Array, camera: Camera): Projected {
  const { count, positions, opacities, origin, antialiased } = cloud;
  const { fx, fy, cx, cy, width, height, near, far, worldToCamera: m } = camera;
  const source = new Uint32Array(count);
  const depths = new Float32Array(count);
  const ellipses = new Float32Array(6 * count);
  const extents = new Float32Array(2 * count);
  const shift = [3, 7, 11].map((k) => m[k - 3] * origin[0] + m[k - 2] * origin[1] + m[k - 1] * origin[2] + m[k]);
  const [marginX, marginY] = [(JACOBIAN_MARGIN * width) / (2 * fx), (JACOBIAN_MARGIN * height) / (2 * fy)];
  const clamp = (value: number, low: number, high: number): number => Math.min(high, Math.max(low, value));
  let kept = 0;
  for (let i = 0; i < count; i++) {
    const [px, py, pz] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
    const z = m[8] * px + m[9] * py + m[10] * pz + shift[2];
    if (!(z > near && z < far)) continue;
    const x = m[0] * px + m[1] * py + m[2] * pz + shift[0];
    const y = m[4] * px + m[5] * py + m[6] * pz + shift[1];
    const slopeX = clamp(x / z, -cx / fx - marginX, (width - cx) / fx + marginX);
    const slopeY = clamp(y / z, -cy / fy - marginY, (height - cy) / fy + marginY);
    let [xx, xy, yy] = [0, 0, 0];
    for (let k = 0; k < 3; k++) {
      const [rx, ry, rz] = [roots[9 * i + k], roots[9 * i + 3 + k], roots[9 * i + 6 + k]];
      const depth = m[8] * rx + m[9] * ry + m[10] * rz;
      const u = (fx / z) * (m[0] * rx + m[1] * ry + m[2] * rz - slopeX * depth);
      const v = (fy / z) * (m[4] * rx + m[5] * ry + m[6] * rz - slopeY * depth);
      xx += u * u;
      xy += u * v;
      yy += v * v;
    }
    const exact = Math.max(0, xx * yy - xy * xy);
    [xx, yy] = [xx + DILATION, yy + DILATION];
    const determinant = xx * yy - xy * xy;
    const opacity = opacities[i] * (antialiased ? Math.sqrt(exact / determinant) : 1);
    if (!(opacity >= ALPHA_MIN) || !(determinant > 0)) continue;
    const [centreX, centreY] = [(fx * x) / z + cx, (fy * y) / z + cy];
    const reach = Math.sqrt(2 * Math.log(opacity / ALPHA_MIN));
    const [halfX, halfY] = [reach * Math.sqrt(xx), reach * Math.sqrt(yy)];
    if (!(centreX + halfX > 0 && centreX - halfX < width && centreY + halfY > 0 && centreY - halfY < height)) continue;
    source[kept] = i;
    depths[kept] = z;
    ellipses.set([centreX, centreY, yy / determinant, -xy / determinant, xx / determinant, opacity], 6 * kept);
    extents.set([halfX, halfY], 2 * kept);
    kept++;
  }
  return { count: kept, source, depths, ellipses, extents };
}

/** Tells the largest weight, and the sum of all squared, of each splat that paints anything, and paints an image where one is wanted. */
function blend(
  { count, source, depths, ellipses, extents }: Projected,
  { width, height }: Camera,
  tell: (source: number, most: number, squares: number) => void,
  paint?: { readonly image: Image; readonly colours: Float32Array },
): void {
  const order = Uint32Array.from({ length: count }, (_, k) => k).sort((a, b) => depths[a] - depths[b] || a - b);
  const transmittance = new Float32Array(width * height).fill(1);
  for (let n = 0; n < count; n++) {
    const k = order[n];
    const at = 6 * k;
    const [centreX, centreY, opacity] = [ellipses[at], ellipses[at + 1], ellipses[at + 5]];
    const [xx, xy, yy] = [ellipses[at + 2], ellipses[at + 3], ellipses[at + 4]];
    const [halfX, halfY] = [extents[2 * k], extents[2 * k + 1]];
    const left = Math.max(0, Math.floor(centreX - halfX));
    const right = Math.min(width - 1, Math.ceil(centreX + halfX));
    const bottom = Math.min(height - 1, Math.ceil(centreY + halfY));
    let most = 0;
    let squares = 0;
    for (let row = Math.max(0, Math.floor(centreY - halfY)); row <= bottom; row++) {
      const dy = row + 0.5 - centreY;
      for (let column = left; column <= right; column++) {
        const pixel = row * width + column;
        const behind = transmittance[pixel];
        if (behind < OPAQUE) continue;
        const dx = column + 0.5 - centreX;
        const power = -0.5 * (xx * dx * dx + yy * dy * dy) - xy * dx * dy;
        // exp(-5.55) is 1/255: less than that no opacity makes visible.
        if (power < -5.55) continue;
        const alpha = Math.min(ALPHA_MAX, opacity * Math.exp(power));
        if (alpha < ALPHA_MIN) continue;
        const weight = alpha * behind;
        if (weight > most) most = weight;
        squares += weight * weight;
        if (paint) addColour(paint.image, 4 * pixel, paint.colours, 3 * k, weight);
        transmittance[pixel] = behind - weight;
      }
    }
    if (most > 0) tell(source[k], most, squares);
  }
}

function addColour(image: Image, at: number, colours: Float32Array, from: number, weight: number): void {
  image[at] += weight * colours[from];
  image[at + 1] += weight * colours[from + 1];
  image[at + 2] += weight * colours[from + 2];
  image[at + 3] += weight;
}
