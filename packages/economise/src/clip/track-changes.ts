import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { ANIMATED_ATTRIBUTES, type AnimatedAttributeName } from '@gaussian-splat/formats';
import { turnBetween } from './write-motion.js';
import type { Tracks } from './tracks.js';

/** Splats of some tracks. */
export interface TrackedSplats {
  readonly cloud: GaussianCloud;
  /** [tracks] index in the cloud of each track's splat, or -1 if the cloud does not have it. */
  readonly placeOf: Int32Array;
}

const EPSILON = 1e-12;

/**
 * Returns the difference of each number of an attribute from the cloud over the frames, [numbers · splats, frames]. It is
 * constant before and after the lifetime of a splat. Undefined if no number changes.
 */
export function changesOfTracks(
  tracks: Tracks,
  splats: TrackedSplats,
  name: AnimatedAttributeName,
): Float32Array | undefined {
  const { frames } = tracks;
  const { count } = splats.cloud;
  const changes = new Float32Array(ANIMATED_ATTRIBUTES[name] * count * frames.length);
  const readOf = name === 'rotation' ? turnsOf(splats) : numbersOf(name, splats.cloud);
  const own = new Float64Array(3);
  let hasChanged = false;
  frames.forEach((frame, f) => {
    tracks.of[f].forEach((track, i) => {
      const place = splats.placeOf[track];
      if (place < 0) return;
      readOf(frame, i, place, own);
      for (let k = 0; k < ANIMATED_ATTRIBUTES[name]; k++) {
        changes[(k * count + place) * frames.length + f] = own[k];
        if (own[k] !== 0) hasChanged = true;
      }
    });
  });
  if (!hasChanged) return undefined;
  splats.placeOf.forEach((place, track) => {
    if (place < 0) return;
    const [first, end] = [tracks.lives.first[track], tracks.lives.end[track]];
    for (let k = 0; k < ANIMATED_ATTRIBUTES[name]; k++) {
      const row = changes.subarray((k * count + place) * frames.length, (k * count + place + 1) * frames.length);
      row.fill(row[first], 0, first);
      row.fill(row[end - 1], end);
    }
  });
  return changes;
}

/** Writes the differences of splat `i` of a frame from splat `place` of the cloud, in the units of `AnimatedAttribute`. */
type Read = (frame: GaussianCloud, i: number, place: number, out: Float64Array) => void;

function numbersOf(name: Exclude<AnimatedAttributeName, 'rotation'>, cloud: GaussianCloud): Read {
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  const reads: Record<Exclude<AnimatedAttributeName, 'rotation'>, Read> = {
    position: (frame, i, place, out) => {
      for (let k = 0; k < 3; k++)
        out[k] = frame.positions[3 * i + k] + (frame.origin[k] - cloud.origin[k]) - cloud.positions[3 * place + k];
    },
    scale: (frame, i, place, out) => {
      for (let k = 0; k < 3; k++)
        out[k] = Math.log(Math.max(EPSILON, frame.scales[3 * i + k]) / Math.max(EPSILON, cloud.scales[3 * place + k]));
    },
    opacity: (frame, i, place, out) => {
      out[0] = frame.opacities[i] - cloud.opacities[place];
    },
    color: (frame, i, place, out) => {
      for (let k = 0; k < 3; k++) out[k] = frame.sh[stride * i + k] - cloud.sh[stride * place + k];
    },
  };
  return reads[name];
}

/** Returns a function that writes rotation vectors. Of the vectors of a rotation, it selects that nearest to the last. */
function turnsOf({ cloud }: TrackedSplats): Read {
  const last = new Float64Array(4 * cloud.count);
  const turn = new Float64Array(4);
  const from = new Float32Array(4);
  const to = new Float32Array(4);
  return (frame, i, place, out) => {
    for (let k = 0; k < 4; k++) {
      from[k] = cloud.rotations[4 * place + k];
      to[k] = frame.rotations[4 * i + k];
    }
    turnBetween(from, to, 0, turn);
    let cosine = 0;
    for (let k = 0; k < 4; k++) cosine += last[4 * place + k] * turn[k];
    // For a splat without a previous frame, the vector with the smaller angle is selected.
    const sign = (cosine || turn[0]) < 0 ? -1 : 1;
    for (let k = 0; k < 4; k++) last[4 * place + k] = turn[k] *= sign;
    const length = Math.hypot(turn[1], turn[2], turn[3]);
    const factor = length > 1e-12 ? (2 * Math.atan2(length, turn[0])) / length : 2;
    for (let k = 0; k < 3; k++) out[k] = factor * turn[k + 1];
  };
}
