import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { ANIMATED_ATTRIBUTES, type AnimatedAttributeName } from '@gaussian-splat/formats';
import { turnBetween } from './curves.js';
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
  const reader = (): Read => (name === 'rotation' ? turnsOf(splats) : numbersOf(name, splats.cloud));
  // Attributes that never change are frequent, and this is faster than writing all differences.
  if (!hasChanges(tracks, splats, reader())) return undefined;
  const readOf = reader();
  const own = new Float64Array(3);
  const changes = new Float32Array(ANIMATED_ATTRIBUTES[name] * count * frames.length);
  frames.forEach((frame, f) => {
    tracks.of[f].forEach((track, i) => {
      const place = splats.placeOf[track];
      if (place < 0) return;
      readOf(frame, i, place, own);
      for (let k = 0; k < ANIMATED_ATTRIBUTES[name]; k++) changes[(k * count + place) * frames.length + f] = own[k];
    });
  });
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

/** Returns whether any splat of any frame differs from the cloud. */
function hasChanges({ frames, of }: Tracks, { placeOf }: TrackedSplats, readOf: Read): boolean {
  const own = new Float64Array(3);
  return frames.some((frame, f) =>
    of[f].some((track, i) => {
      if (placeOf[track] < 0) return false;
      readOf(frame, i, placeOf[track], own);
      return own[0] !== 0 || own[1] !== 0 || own[2] !== 0;
    }),
  );
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

/**
 * Returns a function that writes rotation vectors. Vectors of one rotation differ by whole turns; that nearest to the last
 * vector is selected, so that a splat that spins has a steady vector.
 */
function turnsOf({ cloud }: TrackedSplats): Read {
  const last = new Float64Array(3 * cloud.count);
  const turn = new Float64Array(4);
  return (frame, i, place, out) => {
    turnBetween(cloud, place, frame, i, turn);
    const before = last.subarray(3 * place, 3 * place + 3);
    const size = Math.hypot(turn[1], turn[2], turn[3]);
    const lastSize = Math.hypot(before[0], before[1], before[2]);
    // Near whole turns, the axis is that of the last vector.
    const axisOf = (k: number): number => (size > 1e-6 ? turn[k + 1] / size : lastSize > 0 ? before[k] / lastSize : 0);
    const axis = [axisOf(0), axisOf(1), axisOf(2)];
    const angle = 2 * Math.atan2(size, turn[0]);
    const along = axis[0] * before[0] + axis[1] * before[1] + axis[2] * before[2];
    const nearest = angle + 2 * Math.PI * Math.round((along - angle) / (2 * Math.PI));
    for (let k = 0; k < 3; k++) before[k] = out[k] = nearest * axis[k];
  };
}
