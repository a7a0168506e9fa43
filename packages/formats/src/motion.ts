/** Motion of splats over the frames of a group, and the splats of one of its frames. */
import { keepUsable, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { type LoadBudget } from './budget.js';
import { HarmonicsTurner } from './clip/turn-harmonics.js';
import { noSplats } from './scene-errors.js';

/** Animated attributes in the order of files, each with its count of numbers for a splat. */
export const ANIMATED_ATTRIBUTES = { position: 3, rotation: 3, scale: 3, opacity: 1, color: 3 } as const;
export type AnimatedAttributeName = keyof typeof ANIMATED_ATTRIBUTES;
export const ANIMATED_ATTRIBUTE_NAMES = Object.keys(ANIMATED_ATTRIBUTES) as readonly AnimatedAttributeName[];

/** Maximum absolute value of a curve. Normal curves have values of about 1. */
export const MAX_CURVE = 1e6;

/**
 * Motion of one attribute. At frame f, number n of a splat's attribute changes by step · Σ_k curves[f, k] · codes[n, k].
 * The change of scales is in natural logarithms, and that of rotations is a rotation vector in radians.
 */
export interface AnimatedAttribute {
  /** Number of curves, which all splats share. 0 if the attribute does not change. */
  readonly rank: number;
  /** Number of the last curves that run in the age of each splat: f counts from its first frame. */
  readonly aged: number;
  readonly step: number;
  /** Values of the curves, [frames, rank]. */
  readonly curves: Float32Array;
  /** Arrays of weights, [numbers of the attribute, rank]. Each array has the weight of one curve for each splat. */
  readonly codes: readonly Int16Array[];
}

/** Lifetime of each splat: frames from `first` to `end`, excluding `end`. Both arrays are [splats]. */
export interface Lives {
  readonly first: Uint16Array;
  readonly end: Uint16Array;
  /** Fades at the ends of the lifetimes. Undefined if all splats appear and disappear at once. */
  readonly fades?: Fades | undefined;
}

/**
 * Fade of each splat's opacity at the ends of its lifetime, in 255ths; the arrays are [splats]. At frame f, the fraction
 * of the opacity is min(255, begin + rise · (f − first), last + fall · (end − 1 − f)) / 255.
 */
export type Fades = Readonly<Record<(typeof FADE_NAMES)[number], Uint8Array>>;
export const FADE_NAMES = ['begin', 'rise', 'last', 'fall'] as const;

/** Returns the fraction of the opacity of splat `i`, 0..1, at a frame of its lifetime. */
export function fadeAt(
  { begin, rise, last, fall }: Fades,
  { first, end }: Pick<Lives, 'first' | 'end'>,
  i: number,
  frame: number,
): number {
  const [since, until] = [frame - first[i], end[i] - 1 - frame];
  return Math.min(255, begin[i] + rise[i] * since, last[i] + fall[i] * until) / 255;
}

/** Motion of all splats over some frames, relative to a cloud. */
export interface Motion {
  readonly splats: number;
  readonly frames: number;
  readonly parts: Readonly<Record<AnimatedAttributeName, AnimatedAttribute>>;
  readonly lives: Lives;
  /** Whether the spherical harmonics of a splat turn with its change of rotation. */
  readonly turnsHarmonics: boolean;
}

/** Frame after the last of splats that never change. */
const ALWAYS = 65_535;

/** Returns the motion of splats that never change: they are the same in every frame. */
export function stillMotion(splats: number): Motion {
  const none: AnimatedAttribute = { rank: 0, aged: 0, step: 1, curves: new Float32Array(0), codes: [] };
  const parts = Object.fromEntries(ANIMATED_ATTRIBUTE_NAMES.map((name) => [name, none])) as Motion['parts'];
  const lives = { first: new Uint16Array(splats), end: new Uint16Array(splats).fill(ALWAYS) };
  return { splats, frames: 1, parts, lives, turnsHarmonics: false };
}

/**
 * Returns the splats of a frame of the motion, as a new cloud.
 * @param first Cloud to which the motion applies; it is not modified.
 * @param frame Index of the frame in the motion, from 0.
 * @param budget Account that is charged for the new cloud.
 * @throws GaussianSplatError `decode/empty` if no splat is drawable, `out-of-memory/budget`
 */
export function applyMotion(
  first: GaussianCloud,
  motion: Motion,
  frame: number,
  name: string,
  budget: LoadBudget,
): GaussianCloud {
  budget.takeSplats(first.count, first.shDegree, name);
  const usable = keepUsable(movedCloud(first, motion, frame));
  if (usable.count > 0) return usable;
  throw noSplats(name, usable);
}

/**
 * Returns the splats of a frame of the motion, as a new cloud with the same rows. Splats that are absent have opacity 0.
 * @param frame Index of the frame in the motion, from 0.
 */
export function movedCloud(
  first: GaussianCloud,
  { parts, lives, turnsHarmonics }: Motion,
  frame: number,
): GaussianCloud {
  const cloud = {
    ...first,
    positions: first.positions.slice(),
    scales: first.scales.slice(),
    rotations: first.rotations.slice(),
    opacities: first.opacities.slice(),
    sh: first.sh.slice(),
  };
  const change = new Float32Array(first.count);
  const eachNumber = (part: AnimatedAttributeName, put: (number: number) => void): void => {
    const { rank, aged, step, curves, codes } = parts[part];
    if (rank === 0) return;
    for (let number = 0; number < ANIMATED_ATTRIBUTES[part]; number++) {
      change.fill(0);
      for (let k = 0; k < rank; k++) {
        const own = codes[rank * number + k];
        if (k < rank - aged) {
          const factor = step * curves[rank * frame + k];
          for (let i = 0; i < own.length; i++) change[i] += factor * own[i];
          continue;
        }
        for (let i = 0; i < own.length; i++)
          if (own[i] !== 0 && isAlive(lives, i, frame))
            change[i] += step * curves[rank * (frame - lives.first[i]) + k] * own[i];
      }
      put(number);
    }
  };
  const add = (values: Float32Array, stride: number) => (number: number) => {
    for (let i = 0; i < change.length; i++) values[stride * i + number] += change[i];
  };
  eachNumber('position', add(cloud.positions, 3));
  eachNumber('scale', (number) => {
    for (let i = 0; i < change.length; i++) cloud.scales[3 * i + number] *= Math.exp(change[i]);
  });
  if (lives.fades) for (let i = 0; i < first.count; i++) cloud.opacities[i] *= fadeAt(lives.fades, lives, i, frame);
  eachNumber('opacity', add(cloud.opacities, 1));
  eachNumber('color', add(cloud.sh, 3 * shCoefficientCount(first.shDegree)));
  if (parts.rotation.rank > 0) {
    const turns = new Float32Array(3 * first.count);
    eachNumber('rotation', add(turns, 3));
    turnBy(cloud.rotations, turns);
    if (turnsHarmonics && first.shDegree > 0) turnHarmonics(cloud, turns);
  }
  for (let i = 0; i < first.count; i++) if (!isAlive(lives, i, frame)) hide(cloud, first, i);
  return cloud;
}

const isAlive = ({ first, end }: Lives, i: number, frame: number): boolean => frame >= first[i] && frame < end[i];

/** Sets the opacity of splat `i` to 0, and restores its position, scales and rotation: curves apply only to its lifetime. */
function hide(cloud: GaussianCloud, first: GaussianCloud, i: number): void {
  cloud.opacities[i] = 0;
  cloud.positions.set(first.positions.subarray(3 * i, 3 * i + 3), 3 * i);
  cloud.scales.set(first.scales.subarray(3 * i, 3 * i + 3), 3 * i);
  cloud.rotations.set(first.rotations.subarray(4 * i, 4 * i + 4), 4 * i);
}

/** Rotates the spherical harmonics of a cloud in place by rotation vectors, [N, 3]. */
function turnHarmonics({ count, shDegree, sh }: GaussianCloud, turns: Float32Array): void {
  const turner = new HarmonicsTurner(shDegree);
  for (let i = 0; i < count; i++) {
    const [x, y, z] = [turns[3 * i], turns[3 * i + 1], turns[3 * i + 2]];
    const angle = Math.hypot(x, y, z);
    if (angle === 0) continue;
    const s = Math.sin(angle / 2) / angle;
    turner.turn(sh, i, [Math.cos(angle / 2), s * x, s * y, s * z]);
  }
}

/** Rotates quaternions (w, x, y, z) in place by rotation vectors, [N, 3], whose length is the angle in radians. */
function turnBy(rotations: Float32Array, turns: Float32Array): void {
  for (let i = 0; i < turns.length / 3; i++) {
    const [x, y, z] = [turns[3 * i], turns[3 * i + 1], turns[3 * i + 2]];
    const angle = Math.hypot(x, y, z);
    const [c, s] = [Math.cos(angle / 2), angle > 0 ? Math.sin(angle / 2) / angle : 0.5];
    const [p, q, r] = [s * x, s * y, s * z];
    const at = 4 * i;
    const [w, a, b, d] = [rotations[at], rotations[at + 1], rotations[at + 2], rotations[at + 3]];
    rotations[at] = c * w - p * a - q * b - r * d;
    rotations[at + 1] = c * a + p * w + q * d - r * b;
    rotations[at + 2] = c * b - p * d + q * w + r * a;
    rotations[at + 3] = c * d + p * b - q * a + r * w;
  }
}
