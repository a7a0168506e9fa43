/** Tracks of the objects of a `.4dgs` file, which move as rigid bodies: section 5.15.7 of its specification. */
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import type { Cursor } from './wire.js';

type Quaternion = readonly [w: number, x: number, y: number, z: number];

/** Rotation and translation, in this order, from the stored positions of an object's splats to those in the scene. */
export interface Pose {
  readonly rotation: Quaternion;
  readonly translation: readonly [number, number, number];
}

export interface ObjectTrack {
  readonly object: number;
  readonly isStepped: boolean;
  readonly samples: readonly (Pose & { readonly seconds: number })[];
}

const BYTES_PER_SAMPLE = 64;

export function readTrack(cursor: Cursor): ObjectTrack {
  const { name } = cursor;
  const [object, interpolation, count] = [cursor.u32(), cursor.u8(), cursor.u32()];
  if (object === 0) throw damaged(name, 'tracks of objects from 1 on', 'object 0', 'decode/header');
  if (interpolation > 1)
    throw damaged(name, 'tracks that are linear or stepped', `interpolation ${interpolation}`, 'decode/unsupported');
  if (BYTES_PER_SAMPLE * count > cursor.left)
    throw damaged(name, `${grouped(count)} samples`, `${grouped(cursor.left)} bytes`, 'decode/truncated');
  let last = -Infinity;
  const samples = Array.from({ length: count }, () => {
    const [seconds, x, y, z, w, ...translation] = cursor.numbers(8);
    const length = Math.hypot(x, y, z, w);
    if (
      !(seconds > last && seconds < Infinity) ||
      !(length > 0 && length < Infinity) ||
      !translation.every(Number.isFinite)
    )
      throw damaged(name, 'poses of finite numbers at increasing times', `others for object ${object}`);
    last = seconds;
    const rotation: Quaternion = [w / length, x / length, y / length, z / length];
    return { seconds, rotation, translation: translation as unknown as Pose['translation'] };
  });
  return { object, isStepped: interpolation === 1, samples };
}

/** Returns the interpolated pose at a time in seconds. Outside the samples it is the pose of the nearest sample. */
export function poseAt({ samples, isStepped }: ObjectTrack, seconds: number): Pose {
  // Binary search, because each splat of an object needs the pose.
  let [next, end] = [0, samples.length];
  while (next < end) {
    const middle = (next + end) >> 1;
    if (samples[middle].seconds > seconds) end = middle;
    else next = middle + 1;
  }
  if (next === 0 || next === samples.length) return samples[next === 0 ? 0 : next - 1];
  const [a, b] = [samples[next - 1], samples[next]];
  if (isStepped) return a;
  const share = (seconds - a.seconds) / (b.seconds - a.seconds);
  const translation = a.translation.map((value, k) => value + share * (b.translation[k] - value));
  return {
    rotation: between(a.rotation, b.rotation, share),
    translation: translation as unknown as Pose['translation'],
  };
}

/** Interpolates spherically between two rotations, over the smaller angle. @param share 0 at `a`, 1 at `b`. */
function between(a: Quaternion, b: Quaternion, share: number): Quaternion {
  const dot = a.reduce((sum, value, k) => sum + value * b[k], 0);
  const angle = Math.acos(Math.min(1, Math.abs(dot)));
  const [from, to] =
    angle < 1e-6
      ? [1 - share, share]
      : [Math.sin((1 - share) * angle) / Math.sin(angle), Math.sin(share * angle) / Math.sin(angle)];
  const sum = a.map((value, k) => from * value + (dot < 0 ? -to : to) * b[k]);
  const length = Math.hypot(...sum);
  return sum.map((value) => value / length) as unknown as Quaternion;
}

/** Returns Hamilton's product a ⊗ b of quaternions (w, x, y, z). */
export function product([w, x, y, z]: ArrayLike<number> & Iterable<number>, b: ArrayLike<number>): Quaternion {
  return [
    w * b[0] - x * b[1] - y * b[2] - z * b[3],
    w * b[1] + x * b[0] + y * b[3] - z * b[2],
    w * b[2] - x * b[3] + y * b[0] + z * b[1],
    w * b[3] + x * b[2] - y * b[1] + z * b[0],
  ];
}

/** Returns a point (x, y, z) rotated about the origin by a unit quaternion. */
export function turnedPoint(rotation: Quaternion, point: readonly number[]): number[] {
  const [w, x, y, z] = rotation;
  const inverse: Quaternion = [w, -x, -y, -z];
  return product(product(rotation, [0, ...point]), inverse).slice(1);
}
