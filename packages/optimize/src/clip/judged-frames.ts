/** Selects the frames of a group whose images are measured: those with the largest errors, and some others. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { shCoefficientCount } from '@gaussian-splat/core';
import { movedCloud, type ClipPartContent } from '@gaussian-splat/formats';
import type { TrackedPart } from './clip-part.js';
import type { Tracks } from './tracks.js';

/** Number of measured frames with the largest errors, and of frames that are independent of errors. */
const [WORST, RANDOM] = [5, 2];
/** Squared contrast of colors next to a splat, relative to which errors of its place and shape count. */
const CONTRAST = 0.05;
const SH_C0 = 0.28209479177387814;

/**
 * Returns the estimated error of each frame of a group, [frames], without images: the squared errors of attributes in the
 * measure in which they change an image, relative to the splats of the frame.
 * @param parts Parts with the content that a clip has for them.
 */
export function attributeErrors(
  tracks: Tracks,
  parts: readonly (readonly [part: TrackedPart, content: ClipPartContent])[],
): Float64Array {
  return Float64Array.from(tracks.frames, (frame, f) => {
    const moved = parts.map(([, { cloud, motion }]) => movedCloud(cloud, motion, f));
    let [sum, area] = [0, 0];
    tracks.of[f].forEach((track, i) => {
      for (const [k, [{ placeOf }]] of parts.entries()) {
        const place = placeOf[track];
        if (place < 0) continue;
        sum += imageError(moved[k], place, frame, i);
        area += frame.opacities[i] * areaOf(frame, i);
        break;
      }
    });
    return area > 0 ? sum / area : 0;
  });
}

const areaOf = ({ scales }: GaussianCloud, i: number): number => {
  const [a, b, c] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
  return Math.max(a * b, b * c, c * a);
};

/** Returns the approximate sum over an image of the squared error that splat `i` has as splat `place` of another cloud. */
function imageError(cloud: GaussianCloud, place: number, frame: GaussianCloud, i: number): number {
  const opacity = frame.opacities[i];
  const weight = opacity * opacity;
  const area = areaOf(frame, i);
  let [moved, grown, cosine, color, light] = [0, 0, 0, 0, CONTRAST];
  const [from, to] = [3 * shCoefficientCount(cloud.shDegree), 3 * shCoefficientCount(frame.shDegree)];
  for (let k = 0; k < 3; k++) {
    const own = cloud.positions[3 * place + k] + cloud.origin[k] - frame.positions[3 * i + k] - frame.origin[k];
    moved += own * own;
    const size = Math.log((cloud.scales[3 * place + k] + 1e-12) / (frame.scales[3 * i + k] + 1e-12));
    grown += Math.min(1, size * size);
    light += (SH_C0 * frame.sh[to * i + k]) ** 2 / 3;
  }
  // The mean square of each basis function over all directions is that of the constant one.
  for (let k = 0; k < Math.min(from, to); k++)
    color += (SH_C0 * (cloud.sh[from * place + k] - frame.sh[to * i + k])) ** 2;
  for (let k = 0; k < 4; k++) cosine += cloud.rotations[4 * place + k] * frame.rotations[4 * i + k];
  const turned = Math.max(0, 4 * (1 - cosine * cosine));
  const faded = (cloud.opacities[place] - opacity) ** 2;
  const shape = Math.min(area, moved / 2) + area * Math.min(1, grown / 2 + turned / 4);
  return weight * (color * area + light * shape) + faded * light * area;
}

/**
 * Returns the indices of the frames to measure: the first and the last, some random ones, and those with the largest
 * errors, which are not neighbors.
 * @param errors [frames] estimated errors.
 * @param seed Seed of the random frames.
 */
export function judgedFrames(errors: Float64Array, seed: number): number[] {
  const frames = errors.length;
  const chosen = new Set([0, frames - 1]);
  for (let k = 0; k < RANDOM; k++) chosen.add(Math.floor(frames * ((0.6180339887 * (RANDOM * seed + k + 1)) % 1)));
  const apart = frames > 4 * WORST ? 2 : 1;
  const order = [...errors.keys()].sort((a, b) => errors[b] - errors[a]);
  const worst: number[] = [];
  for (const f of order) {
    if (worst.length === WORST) break;
    if (worst.every((other) => Math.abs(other - f) >= apart)) worst.push(f);
  }
  return [...new Set([...chosen, ...worst])].sort((a, b) => a - b);
}
