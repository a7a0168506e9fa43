import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { Lives } from '@gaussian-splat/formats';
import { alignAxes } from './near-axes.js';
import { featuresOf, matchFrames, type Features } from './match-frames.js';

/** Tracks of a group of frames. A track is a splat that is identified in consecutive frames. */
export interface Tracks {
  readonly count: number;
  /** Frames with a consistent order of axes for the splats of each track. */
  readonly frames: readonly GaussianCloud[];
  /** For each frame, the track of each splat, [splats of the frame]. */
  readonly of: readonly Int32Array[];
  /** Lifetime of each track. */
  readonly lives: Lives;
}

/** Finds the tracks of frames by {@link matchFrames}. Unmatched splats begin a track, and tracks without a match end. */
export function followSplats(sources: readonly GaussianCloud[]): Tracks {
  const { origin } = sources[0];
  const frames: GaussianCloud[] = [sources[0]];
  const of: Int32Array[] = [Int32Array.from({ length: sources[0].count }, (_, i) => i)];
  const first = Array.from({ length: sources[0].count }, () => 0);
  const end = first.map(() => 1);
  let features = featuresOf(sources[0], origin);
  let velocities = new Float32Array(3 * sources[0].count);
  for (const source of sources.slice(1)) {
    const frame = frames.length;
    const own = featuresOf(source, origin);
    const expected = { ...features, positions: features.positions.map((value, k) => value + velocities[k]) };
    const matches = matchFrames(expected, own);
    frames.push(withAxesOf(source, frames[frame - 1], matches));
    const before = of[frame - 1];
    of.push(
      matches.map((i) => {
        if (i < 0) return first.push(frame) - 1;
        end[before[i]] = frame + 1;
        return before[i];
      }),
    );
    while (end.length < first.length) end.push(frame + 1);
    velocities = velocitiesOf(features, own, matches);
    features = own;
  }
  return { count: first.length, frames, of, lives: { first: Uint16Array.from(first), end: Uint16Array.from(end) } };
}

function velocitiesOf(before: Features, next: Features, matches: Int32Array): Float32Array<ArrayBuffer> {
  const velocities = new Float32Array(3 * next.count);
  matches.forEach((i, j) => {
    if (i < 0) return;
    for (let k = 0; k < 3; k++) velocities[3 * j + k] = next.positions[3 * j + k] - before.positions[3 * i + k];
  });
  return velocities;
}

/** Sum of squared differences of scales' logarithms and quaternions above which a splat's axes may be reordered. */
const SAME_AXES = 0.05;

function withAxesOf(cloud: GaussianCloud, before: GaussianCloud, matches: Int32Array): GaussianCloud {
  const rotations = cloud.rotations.slice();
  const scales = cloud.scales.slice();
  let isSame = true;
  matches.forEach((i, j) => {
    if (i < 0) return;
    rotations.set(before.rotations.subarray(4 * i, 4 * i + 4), 4 * j);
    scales.set(before.scales.subarray(3 * i, 3 * i + 3), 3 * j);
    let [apart, cosine] = [0, 0];
    for (let k = 0; k < 3; k++) apart += Math.log((scales[3 * j + k] + 1e-12) / (cloud.scales[3 * j + k] + 1e-12)) ** 2;
    for (let k = 0; k < 4; k++) cosine += rotations[4 * j + k] * cloud.rotations[4 * j + k];
    if (apart + 1 - cosine * cosine > SAME_AXES) isSame = false;
  });
  return isSame ? cloud : alignAxes(cloud, { ...cloud, rotations, scales });
}

/** Returns a cloud with a splat for each track, copied from the frame of its largest opacity. */
export function cloudOfTracks({ count, frames, of }: Tracks): GaussianCloud {
  const [model] = frames;
  const shNumbers = 3 * shCoefficientCount(model.shDegree);
  const cloud = {
    ...{ ...model, count, faults: undefined, droppedCount: 0 },
    positions: new Float32Array(3 * count),
    scales: new Float32Array(3 * count),
    rotations: new Float32Array(4 * count),
    opacities: new Float32Array(count).fill(-1),
    sh: new Float32Array(shNumbers * count),
  };
  frames.forEach((frame, f) => {
    const shift = frame.origin.map((value, axis) => value - model.origin[axis]);
    of[f].forEach((track, i) => {
      if (frame.opacities[i] <= cloud.opacities[track]) return;
      cloud.opacities[track] = frame.opacities[i];
      for (let k = 0; k < 3; k++) cloud.positions[3 * track + k] = frame.positions[3 * i + k] + shift[k];
      for (let k = 0; k < 3; k++) cloud.scales[3 * track + k] = frame.scales[3 * i + k];
      for (let k = 0; k < 4; k++) cloud.rotations[4 * track + k] = frame.rotations[4 * i + k];
      for (let k = 0; k < shNumbers; k++) cloud.sh[shNumbers * track + k] = frame.sh[shNumbers * i + k];
    });
  });
  return cloud;
}
