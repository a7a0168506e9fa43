/** From integers to splats that change over time: sections 3 and 6 of the specification of `.4dgs`. */
import { shCoefficientCount } from '@gaussian-splat/core';
import { damaged } from '../faults.js';
import type { Grids, Header } from './wire.js';
import { ATTRIBUTE, REQUIRED, type Bins } from './streams.js';

/** Numbers of a splat's constant term, from a color of 0 to 1. */
const SH_C0 = 0.28209479177387814;
/** Values of bytes of spherical harmonics: from -4 to 4. */
const [SH_MIN, SH_STEP] = [-4, 8 / 255];

/** Splats of one state, each with what it does over time. */
export interface ChangingSplats {
  readonly count: number;
  /** [count, 3] relative to the origin of the grid. */
  readonly positions: Float32Array;
  /** [count, 3] units a second. */
  readonly velocities: Float32Array;
  /** [count, 3] standard deviations. */
  readonly scales: Float32Array;
  /** [count, 4] (w, x, y, z). */
  readonly rotations: Float32Array;
  readonly opacities: Float32Array;
  /** [count, coefficients, 3], see `GaussianCloud.sh`. */
  readonly sh: Float32Array;
  /** Seconds at which a splat is where its position says, and most opaque. */
  readonly centers: Float64Array;
  /** Standard deviations of how it fades, seconds; infinite: not at all. */
  readonly fades: Float64Array;
  /** Seconds from which it exists, and until. */
  readonly from: Float64Array;
  readonly until: Float64Array;
  /** Objects that carry splats along; 0: none. */
  readonly objects: Uint32Array;
}

export interface Scene {
  readonly header: Header;
  readonly grids: Grids;
  readonly windows: readonly (readonly [number, number])[];
  readonly name: string;
}

/** @param bands bytes of spherical harmonics, [count, 3, 2 · band + 1] for each band */
export function splatsFrom(bins: Bins, bands: readonly Int32Array[], scene: Scene): ChangingSplats {
  const { header, grids, name } = scene;
  for (const id of REQUIRED)
    if (!bins.has(id)) throw damaged(name, 'all attributes of splats', `no attribute ${id}`, 'decode/header');
  const own = (id: (typeof REQUIRED)[number]): Int32Array => bins.get(id)!;
  const flags = own(ATTRIBUTE.flags);
  const sigma = own(ATTRIBUTE.sigma);
  const count = flags.length;
  const fades = Float64Array.from(sigma, (bin, i) => (flags[i] & 1 ? Infinity : Math.exp(bin * grids.sigmaLog)));
  const [from, until] = spansOf(own(ATTRIBUTE.window), scene);
  const motion = own(ATTRIBUTE.motion);
  const velocities = new Float32Array(3 * count);
  const reach = Math.sqrt(-2 * Math.log(header.cutoff));
  const centers = new Float64Array(count);
  for (let i = 0; i < count; i++) {
    const half = fades[i] === Infinity ? until[i] - from[i] : reach * fades[i];
    const step = grids.motion * 2 ** -lifeClass(half);
    for (let k = 0; k < 3; k++) velocities[3 * i + k] = step * motion[3 * i + k];
    centers[i] = own(ATTRIBUTE.mu)[i] * timeStep(fades[i], grids.time);
  }
  return {
    ...{ count, velocities, centers, fades, from, until },
    positions: Float32Array.from(own(ATTRIBUTE.position), (bin) => bin * grids.position),
    scales: Float32Array.from(own(ATTRIBUTE.scale), (bin) => Math.exp(bin * grids.scaleLog)),
    rotations: rotationsFrom(own(ATTRIBUTE.rotationIndex), own(ATTRIBUTE.rotation), grids.rotation, name),
    opacities: Float32Array.from(own(ATTRIBUTE.opacity), (bin) => Math.min(1, Math.max(0, bin * grids.opacity))),
    sh: harmonicsFrom(own(ATTRIBUTE.color), bands, scene),
    objects: Uint32Array.from(bins.get(ATTRIBUTE.object) ?? new Int32Array(count)),
  };
}

function spansOf(windows: Int32Array, { windows: table, name }: Scene): [Float64Array, Float64Array] {
  const spans = table.length > 0 ? table : [[0, 0] as const];
  const wrong = windows.find((index) => spans[index] === undefined);
  if (wrong !== undefined) throw damaged(`${name}, windows`, `indexes below ${spans.length}`, String(wrong));
  return [0, 1].map((side) => Float64Array.from(windows, (index) => spans[index][side])) as [
    Float64Array,
    Float64Array,
  ];
}

/** Section 6.3: splats that are seen for longer have finer velocities. */
function lifeClass(half: number): number {
  const clamped = Math.min(2, Math.max(0.02, half));
  return Math.min(2, Math.max(-4, Math.ceil(Math.log2(clamped / 0.5))));
}

/** Section 6.3: splats that fade quickly have finer times. */
function timeStep(fade: number, step: number): number {
  const target = Math.min(step, 0.05 * fade);
  return step * 2 ** Math.min(0, Math.max(-10, Math.floor(Math.log2(target / step))));
}

/** Section 6.4: the largest component of (x, y, z, w) is left out. */
function rotationsFrom(indexes: Int32Array, bins: Int32Array, step: number, name: string): Float32Array {
  const rotations = new Float32Array(4 * indexes.length);
  const xyzw = [0, 0, 0, 1];
  indexes.forEach((largest, i) => {
    if (largest < 0 || largest > 3) throw damaged(name, 'rotations without component 0 to 3', String(largest));
    let [at, sum] = [3 * i, 0];
    for (let k = 0; k < 4; k++) {
      if (k === largest) continue;
      xyzw[k] = Math.min(1, Math.max(-1, bins[at++] * step));
      sum += xyzw[k] ** 2;
    }
    xyzw[largest] = Math.sqrt(Math.max(0, 1 - sum));
    const length = Math.hypot(...xyzw) || 1;
    rotations.set([xyzw[3] / length, xyzw[0] / length, xyzw[1] / length, xyzw[2] / length], 4 * i);
  });
  return rotations;
}

/** Color bins are (g, r - g, b - g). */
function harmonicsFrom(colors: Int32Array, bands: readonly Int32Array[], { header, grids, name }: Scene): Float32Array {
  if (bands.length !== header.shDegree)
    throw damaged(name, `${header.shDegree} bands of spherical harmonics`, String(bands.length), 'decode/header');
  const count = colors.length / 3;
  const width = shCoefficientCount(header.shDegree);
  const sh = new Float32Array(3 * width * count);
  for (let i = 0; i < count; i++) {
    const green = colors[3 * i];
    [colors[3 * i + 1] + green, green, colors[3 * i + 2] + green].forEach((bin, channel) => {
      const value = Math.min(1, Math.max(0, bin * grids.color));
      sh[3 * width * i + channel] = (value - 0.5) / SH_C0;
    });
    bands.forEach((codes, k) => {
      const own = 2 * k + 3;
      for (let channel = 0; channel < 3; channel++)
        for (let j = 0; j < own; j++)
          sh[3 * (width * i + (k + 1) ** 2 + j) + channel] = SH_MIN + SH_STEP * codes[3 * own * i + own * channel + j];
    });
  }
  return sh;
}

/** Fraction of its opacity that a splat has at a time; 0 if it does not exist then. */
export function presence(splats: ChangingSplats, i: number, seconds: number, cutoff: number): number {
  if (!(splats.from[i] <= seconds && seconds < splats.until[i])) return 0;
  if (splats.fades[i] === Infinity) return 1;
  const share = Math.exp(-0.5 * ((seconds - splats.centers[i]) / splats.fades[i]) ** 2);
  return share >= cutoff ? share : 0;
}
