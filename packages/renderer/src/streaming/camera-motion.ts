import {
  cross,
  dot,
  eyeOf,
  length,
  scale,
  subtract,
  type Camera,
  type Matrix4,
  type Vector3,
} from '@gaussian-splat/core';

/**
 * Milliseconds of one measuring interval. The motion of the current interval is compared with that of the previous one.
 */
const STRETCH_MS = 50;
/** Maximum milliseconds between two cameras. After a longer time earlier samples are discarded. */
const PAUSE_MS = 250;
/** Maximum ratio of the speed of the current interval to that of the previous one. */
const MAX_GROWTH = 2;
/** Maximum predicted rotation in radians. */
const MAX_TURN = 1;
/** Tolerance of the squared row lengths of a matrix that counts as rotation and translation. */
const SKEW = 1e-3;

/**
 * Milliseconds that are added to the arrival time of a page: for the feedback pass, its read-back, and the parent page,
 * which must be resident first. The second number is the maximum prediction time.
 */
const [LOOK_MS, MAX_AHEAD_MS] = [250, 600];

/**
 * Returns the prediction time of a camera for page requests, in milliseconds.
 * @param arrivalMs Mean milliseconds from the request of a page to its upload.
 */
export const aheadMs = (arrivalMs: number): number => Math.min(MAX_AHEAD_MS, LOOK_MS + arrivalMs);

interface Sample {
  readonly camera: Camera;
  readonly eye: Vector3;
  readonly at: number;
}

/**
 * Velocity of a camera. `moves`: world units per millisecond. `turns`: radians per millisecond, times the axis in
 * camera coordinates.
 */
interface Velocity {
  readonly moves: Vector3;
  readonly turns: Vector3;
}

const STILL: Vector3 = [0, 0, 0];

/**
 * Predicts the motion of a camera. The camera keeps the speed of the last 50 ms, limited by the speed of the 50 ms
 * before. A camera that rests, jumps, oscillates, or was not observed for a while is predicted to stay.
 */
export class CameraMotion {
  readonly #samples: Sample[] = [];

  /** Records the camera of a frame. @param now Current time in milliseconds, from any origin. */
  observe(camera: Camera, now: number): void {
    const last = this.#samples.at(-1);
    if (last && now - last.at > PAUSE_MS) this.#samples.length = 0;
    // Copied, because callers may reuse one matrix for every frame.
    const worldToCamera = Float64Array.from(camera.worldToCamera);
    this.#samples.push({ camera: { ...camera, worldToCamera }, eye: eyeOf(worldToCamera), at: now });
    // Keeps the newest sample that is at least two intervals old. Frames longer than an interval leave three samples.
    while (this.#samples.length > 3 && now - this.#samples[1].at >= 2 * STRETCH_MS) this.#samples.shift();
  }

  /** Whether the camera moves or rotates. */
  get isMoving(): boolean {
    const { moves, turns } = this.#velocity();
    return length(moves) > 0 || length(turns) > 0;
  }

  /**
   * Predicts the last recorded camera after this many milliseconds. Returns the same object if the camera does not
   * move.
   */
  ahead(milliseconds: number): Camera {
    const { camera, eye } = this.#samples.at(-1)!;
    const { moves, turns } = this.#velocity();
    const angle = Math.min(MAX_TURN, milliseconds * length(turns));
    if (length(moves) === 0 && angle === 0) return camera;
    const place = eye.map((x, axis) => x + milliseconds * moves[axis]) as unknown as Vector3;
    return { ...camera, worldToCamera: turned(camera.worldToCamera, turns, angle, place) };
  }

  #velocity(): Velocity {
    const samples = this.#samples;
    const last = samples.length - 1;
    if (last < 2) return { moves: STILL, turns: STILL };
    let middle = last - 1;
    while (middle > 1 && samples[last].at - samples[middle].at < STRETCH_MS) middle--;
    const [before, now] = [between(samples[0], samples[middle]), between(samples[middle], samples[last])];
    return { moves: lasting(before.moves, now.moves), turns: lasting(before.turns, now.turns) };
  }
}

/**
 * Limits a velocity by the previous one. Returns zero if they oppose each other; otherwise the speed is at most {@link
 * MAX_GROWTH} times the previous one.
 */
function lasting(before: Vector3, now: Vector3): Vector3 {
  if (dot(before, now) <= 0) return STILL;
  return scale(now, Math.min(1, (MAX_GROWTH * length(before)) / length(now)));
}

function between(from: Sample, to: Sample): Velocity {
  const milliseconds = Math.max(1e-3, to.at - from.at);
  const [a, b] = [from.camera.worldToCamera, to.camera.worldToCamera];
  const moves = scale(subtract(to.eye, from.eye), 1 / milliseconds);
  return { moves, turns: isRigid(a) && isRigid(b) ? scale(rotationVector(a, b), 1 / milliseconds) : STILL };
}

const row = (m: Matrix4, k: number): Vector3 => [m[4 * k], m[4 * k + 1], m[4 * k + 2]];

const isRigid = (m: Matrix4): boolean => [0, 1, 2].every((k) => Math.abs(length(row(m, k)) - 1) < SKEW);

/** Returns the rotation B Aᵀ between the axes of two cameras as a rotation vector: axis times angle in radians. */
function rotationVector(a: Matrix4, b: Matrix4): Vector3 {
  const of = (i: number, j: number): number => dot(row(b, i), row(a, j));
  const twice: Vector3 = [of(2, 1) - of(1, 2), of(0, 2) - of(2, 0), of(1, 0) - of(0, 1)];
  const sine = length(twice) / 2;
  // A rotation by 180° between two frames has no defined axis, and does not count as motion.
  if (sine < 1e-9) return STILL;
  return scale(twice, Math.atan2(sine, (of(0, 0) + of(1, 1) + of(2, 2) - 1) / 2) / (2 * sine));
}

/**
 * Returns the matrix of a camera whose axes are rotated about an axis in camera coordinates (Rodrigues' formula).
 * @param angle Radians.
 * @param eye World position of the rotated camera.
 */
function turned(m: Matrix4, about: Vector3, angle: number, eye: Vector3): Float64Array {
  const axis = angle === 0 ? STILL : scale(about, 1 / length(about));
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  const column = (k: number): Vector3 => {
    const v: Vector3 = [m[k], m[4 + k], m[8 + k]];
    const [across, along] = [cross(axis, v), dot(axis, v) * (1 - cosine)];
    return [0, 1, 2].map((i) => cosine * v[i] + sine * across[i] + along * axis[i]) as unknown as Vector3;
  };
  const columns = [column(0), column(1), column(2)];
  const rows = [0, 1, 2].map((i) => columns.map((c) => c[i]) as unknown as Vector3);
  return Float64Array.from(rows.flatMap((r) => [...r, -dot(r, eye)]).concat(0, 0, 0, 1));
}
