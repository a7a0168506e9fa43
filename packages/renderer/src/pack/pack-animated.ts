import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { packSh } from './sh.js';
import { shWords } from './words.js';

/** Animated attributes, in the order of shaders/animate.wgsl. */
const ATTRIBUTES = ['position', 'rotation', 'scale', 'opacity', 'color'] as const;
type Attribute = (typeof ATTRIBUTES)[number];

/** Motion of splats over several frames: `Motion` of the package formats. */
export interface Motions {
  readonly frames: number;
  readonly parts: Readonly<
    Record<
      Attribute,
      {
        readonly rank: number;
        /** Number of the last curves whose frames count from the first frame of each splat. */
        readonly aged: number;
        readonly step: number;
        /** [frames, rank] values of each curve in each frame */
        readonly curves: Float32Array;
        /** [width × rank] planes of [splats] codes: the weight of each curve, for each component of the attribute */
        readonly codes: readonly Int16Array[];
      }
    >
  >;
  /** Whether spherical harmonics turn with the change of rotation. */
  readonly turnsHarmonics: boolean;
  /** Range of frames that contain each splat. */
  readonly lives: {
    /** [splats] index of the first frame */
    readonly first: Uint16Array;
    /** [splats] index of the first frame after the last */
    readonly end: Uint16Array;
    /** Fades of the opacity at both ends; undefined if all splats appear and disappear abruptly. */
    readonly fades?: Readonly<Record<'begin' | 'rise' | 'last' | 'fall', Uint8Array>> | undefined;
  };
}

/**
 * Splats and their motion, in the layout that the GPU reads. Plain data with transferable buffers, so that a worker can
 * build it.
 */
export interface PackedAnimation {
  /** Number of splats. */
  readonly rows: number;
  readonly frames: number;
  /** Number of curves of each attribute. */
  readonly ranks: readonly number[];
  /** Number of the last curves of each attribute that run in the age of a splat. */
  readonly aged: readonly number[];
  readonly turnsHarmonics: boolean;
  /** [rows, {@link BASE_WORDS}] words: `Base` of shaders/animate.wgsl. */
  readonly bases: Uint32Array;
  /** [rows, shWords] words, float16. */
  readonly sh: Uint32Array;
  /** [planes + {@link FADE_PLANES}, {@link planeCodes} / 2] words, each with two 16-bit codes */
  readonly codes: Uint32Array;
  /** [frames, sum of ranks] curves, multiplied by their quantization steps */
  readonly curves: Float32Array;
}

export const BASE_WORDS = 12;
/** Number of planes after those of the attributes: one for the appearance of each splat, one for its disappearance. */
const FADE_PLANES = 2;
/** Code of an absent fade: the full opacity from the first frame on. */
const NO_FADE = 255;

/** Returns the number of 16-bit codes of a plane in memory: `rows` rounded up to an even number. */
export const planeCodes = (rows: number): number => rows + (rows & 1);

/** Packs a cloud and its motion. @param origin Origin of the packed positions. */
export function packAnimation(cloud: GaussianCloud, motions: Motions, origin: Vector3): PackedAnimation {
  const { frames, parts } = motions;
  const rows = cloud.count;
  const all = Uint32Array.from({ length: rows }, (_, i) => i);
  const ranks = ATTRIBUTES.map((name) => parts[name].rank);
  const planes = ATTRIBUTES.flatMap((name) => parts[name].codes);
  const codes = new Uint32Array((planeCodes(rows) / 2) * (planes.length + FADE_PLANES));
  const halves = new Int16Array(codes.buffer);
  [...planes, ...fadePlanes(rows, motions.lives.fades)].forEach((plane, k) => halves.set(plane, k * planeCodes(rows)));
  const curveCount = ranks.reduce((sum, rank) => sum + rank, 0);
  const curves = new Float32Array(frames * curveCount);
  let at = 0;
  for (const name of ATTRIBUTES) {
    const { rank, step, curves: own } = parts[name];
    for (let f = 0; f < frames; f++)
      for (let k = 0; k < rank; k++) curves[f * curveCount + at + k] = step * own[f * rank + k];
    at += rank;
  }
  return {
    ...{ rows, frames, ranks, codes, curves, turnsHarmonics: motions.turnsHarmonics },
    aged: ATTRIBUTES.map((name) => parts[name].aged),
    bases: packBases(cloud, motions, origin),
    sh: packSh(cloud, all, 'float16'),
  };
}

function fadePlanes(rows: number, fades: Motions['lives']['fades']): readonly Int16Array[] {
  if (!fades) return Array.from({ length: FADE_PLANES }, () => new Int16Array(rows).fill(NO_FADE));
  const plane = (ends: Uint8Array, slopes: Uint8Array): Int16Array =>
    Int16Array.from(ends, (end, i) => end | (slopes[i] << 8));
  return [plane(fades.begin, fades.rise), plane(fades.last, fades.fall)];
}

function packBases(cloud: GaussianCloud, { lives }: Motions, origin: Vector3): Uint32Array {
  const { count, positions, scales, rotations, opacities } = cloud;
  const words = new Uint32Array(BASE_WORDS * count);
  const floats = new Float32Array(words.buffer);
  for (let i = 0; i < count; i++) {
    const at = BASE_WORDS * i;
    for (let k = 0; k < 3; k++) floats[at + k] = positions[3 * i + k] + (cloud.origin[k] - origin[k]);
    words[at + 3] = lives.first[i] | (lives.end[i] << 16);
    for (let k = 0; k < 3; k++) floats[at + 4 + k] = scales[3 * i + k];
    floats[at + 7] = opacities[i];
    for (let k = 0; k < 3; k++) floats[at + 8 + k] = rotations[4 * i + 1 + k];
    floats[at + 11] = rotations[4 * i];
  }
  return words;
}

/** Returns the size in GPU memory of each buffer of a part, in bytes. */
export function animationBytes({
  rows,
  planes,
  frames,
  shDegree,
}: AnimationRoom): Readonly<Record<'bases' | 'sh' | 'codes' | 'curves', number>> {
  return {
    bases: 4 * BASE_WORDS * rows,
    sh: 4 * shWords(shDegree, 'float16') * rows,
    codes: 2 * planeCodes(rows) * (planes + FADE_PLANES),
    // Each plane contains the weights of one curve.
    curves: 4 * frames * planes,
  };
}

/** Capacity of a part: its rows, planes and frames. */
export interface AnimationRoom {
  readonly rows: number;
  readonly planes: number;
  readonly frames: number;
  readonly shDegree: GaussianCloud['shDegree'];
}
