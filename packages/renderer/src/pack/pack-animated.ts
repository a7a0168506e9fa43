import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { packSh } from './sh.js';
import { shWords } from './words.js';

/** Animated attributes, in the order of shaders/animate.wgsl. */
const ATTRIBUTES = ['position', 'rotation', 'scale', 'opacity', 'color'] as const;
type Attribute = (typeof ATTRIBUTES)[number];

/** Motion of splats over some frames: `Motion` of the package formats. */
export interface Motions {
  readonly frames: number;
  readonly parts: Readonly<
    Record<
      Attribute,
      {
        readonly rank: number;
        readonly step: number;
        /** [frames, rank] */
        readonly curves: Float32Array;
        /** [width, rank] of [splats] */
        readonly codes: readonly Int16Array[];
      }
    >
  >;
  /** Frames that contain each splat; undefined: all. */
  readonly lives?: { readonly first: Uint16Array; readonly end: Uint16Array } | undefined;
}

/**
 * Splats and their motion in the bytes that the GPU reads. Plain data with transferable buffers, so that a worker can
 * build it.
 */
export interface PackedAnimation {
  readonly rows: number;
  readonly frames: number;
  /** Number of curves of each attribute. */
  readonly ranks: readonly number[];
  /** [rows, {@link BASE_WORDS}] words: `Base` of shaders/animate.wgsl. */
  readonly bases: Uint32Array;
  /** [rows, shWords] words, float16. */
  readonly sh: Uint32Array;
  /** [planes, rows made even / 2] words. */
  readonly codes: Uint32Array;
  /** [frames, sum of ranks], multiplied by the quantization steps. */
  readonly curves: Float32Array;
}

export const BASE_WORDS = 12;

/** Codes of a plane in memory: an even number. */
export const planeCodes = (rows: number): number => rows + (rows & 1);

/** @param origin Origin of the packed positions. */
export function packAnimation(cloud: GaussianCloud, motions: Motions, origin: Vector3): PackedAnimation {
  const { frames, parts } = motions;
  const rows = cloud.count;
  const all = Uint32Array.from({ length: rows }, (_, i) => i);
  const ranks = ATTRIBUTES.map((name) => parts[name].rank);
  const planes = ATTRIBUTES.flatMap((name) => parts[name].codes);
  const codes = new Uint32Array((planeCodes(rows) / 2) * planes.length);
  const halves = new Int16Array(codes.buffer);
  planes.forEach((plane, k) => halves.set(plane, k * planeCodes(rows)));
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
    ...{ rows, frames, ranks, codes, curves },
    bases: packBases(cloud, motions, origin),
    sh: packSh(cloud, all, 'float16'),
  };
}

function packBases(cloud: GaussianCloud, { lives, frames }: Motions, origin: Vector3): Uint32Array {
  const { count, positions, scales, rotations, opacities } = cloud;
  const words = new Uint32Array(BASE_WORDS * count);
  const floats = new Float32Array(words.buffer);
  for (let i = 0; i < count; i++) {
    const at = BASE_WORDS * i;
    for (let k = 0; k < 3; k++) floats[at + k] = positions[3 * i + k] + (cloud.origin[k] - origin[k]);
    words[at + 3] = (lives ? lives.first[i] : 0) | ((lives ? lives.end[i] : frames) << 16);
    for (let k = 0; k < 3; k++) floats[at + 4 + k] = scales[3 * i + k];
    floats[at + 7] = opacities[i];
    for (let k = 0; k < 3; k++) floats[at + 8 + k] = rotations[4 * i + 1 + k];
    floats[at + 11] = rotations[4 * i];
  }
  return words;
}

/** Bytes of GPU memory that a part takes. */
export function animationBytes({
  rows,
  planes,
  frames,
  shDegree,
}: AnimationRoom): Readonly<Record<'bases' | 'sh' | 'codes' | 'curves', number>> {
  return {
    bases: 4 * BASE_WORDS * rows,
    sh: 4 * shWords(shDegree, 'float16') * rows,
    codes: 2 * planeCodes(rows) * planes,
    // Each plane belongs to a curve.
    curves: 4 * frames * planes,
  };
}

/** Capacity of a part. */
export interface AnimationRoom {
  readonly rows: number;
  readonly planes: number;
  readonly frames: number;
  readonly shDegree: GaussianCloud['shDegree'];
}
