import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { Tracks } from './tracks.js';

/** Minimum changes between two frames that may be jumps: a rotation in radians. */
const MIN_TURN = 0.15;
/** A change of the natural logarithm of a scale. */
const MIN_GROWTH = 0.15;
/** Minimum change of a constant SH coefficient that counts as a jump. */
const MIN_COLOR = 0.1;
/** Minimum ratio of a jump to the change in the previous or next pair of frames. */
const JUMP = 4;
/** Minimum ratio of a jump to the median change of all splats: those of frames that were trained one by one are noisy. */
const NOISE = 5;

/**
 * Divides tracks at jumps of rotation, scales or color, because the track continues with another splat there. No curve
 * approximates a jump, and a further splat needs fewer bytes.
 */
export function cutTracks(tracks: Tracks): Tracks {
  const { frames, of } = tracks;
  const changes = changesOfLooks(tracks);
  const min = changes.map((own) => Math.max(1, NOISE * medianOf(own)));
  const first = Array.from(tracks.lives.first);
  const end = Array.from(tracks.lives.end);
  const names = Int32Array.from({ length: tracks.count }, (_, track) => track);
  const before = new Float32Array(tracks.count).fill(NaN);
  const after = new Float32Array(tracks.count);
  const named = of.map((own, frame) => {
    after.fill(NaN);
    of[frame + 1]?.forEach((track, i) => (after[track] = changes[frame + 1][i]));
    return own.map((track, i) => {
      const change = changes[frame][i];
      // Comparisons with missing neighbors are false.
      if (change > min[frame] && (change > JUMP * before[track] || change > JUMP * after[track])) {
        end[names[track]] = frame;
        names[track] = first.push(frame) - 1;
        end.push(tracks.lives.end[track]);
      }
      before[track] = change;
      return names[track];
    });
  });
  const lives = { first: Uint16Array.from(first), end: Uint16Array.from(end) };
  return { count: first.length, frames, of: named, lives };
}

/** Returns the median of numbers that are not NaN; 0 if there are none. */
function medianOf(values: Float32Array): number {
  const sorted = values.filter((value) => value >= 0).sort();
  return sorted[sorted.length >> 1] ?? 0;
}

/**
 * Returns, for each frame, the change of each splat since the previous frame, [splats of the frame], as
 * {@link looksApart}. NaN for splats that begin.
 */
function changesOfLooks({ count, frames, of }: Tracks): readonly Float32Array[] {
  let last = new Int32Array(count).fill(-1);
  return frames.map((frame, f) => {
    const next = new Int32Array(count).fill(-1);
    const changes = Float32Array.from(of[f], (track, i) => {
      next[track] = i;
      return last[track] < 0 ? NaN : looksApart(frames[f - 1], last[track], frame, i);
    });
    last = next;
    return changes;
  });
}

/** Returns the largest difference of rotation, scales and color, relative to the minimum of a jump. */
function looksApart(a: GaussianCloud, i: number, b: GaussianCloud, j: number): number {
  let [cosine, growth, color] = [0, 0, 0];
  for (let k = 0; k < 4; k++) cosine += a.rotations[4 * i + k] * b.rotations[4 * j + k];
  for (let k = 0; k < 3; k++)
    growth = Math.max(growth, Math.abs(Math.log((a.scales[3 * i + k] + 1e-12) / (b.scales[3 * j + k] + 1e-12))));
  const stride = 3 * shCoefficientCount(a.shDegree);
  for (let k = 0; k < 3; k++) color = Math.max(color, Math.abs(a.sh[stride * i + k] - b.sh[stride * j + k]));
  const turn = 2 * Math.acos(Math.min(1, Math.abs(cosine)));
  return Math.max(turn / MIN_TURN, growth / MIN_GROWTH, color / MIN_COLOR);
}
