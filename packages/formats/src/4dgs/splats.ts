/** Conversion of integers to splats that change over time: sections 3 and 6 of the specification of `.4dgs`. */
import { shCoefficientCount } from '@gaussian-splat/core';
import { damaged } from '../faults.js';
import type { Grids, Header } from './wire.js';
import { ATTRIBUTE, REQUIRED, type Bins } from './streams.js';

/** Value of the constant spherical harmonic, 1/(2·sqrt(pi)): color = 0.5 + SH_C0·coefficient. */
const SH_C0 = 0.28209479177387814;
/** Minimum and step of the coefficients that bytes represent, in -4..4. */
const [SH_MIN, SH_STEP] = [-4, 8 / 255];

/** Splats of one state, with their changes over time. */
export interface ChangingSplats {
  readonly count: number;
  /** [count, 3] positions at the times {@link centers}, relative to the origin of the grid. */
  readonly positions: Float32Array;
  /** [count, 3] velocities in units per second. */
  readonly velocities: Float32Array;
  /** [count, 3] standard deviations. */
  readonly scales: Float32Array;
  /** [count, 4] (w, x, y, z). */
  readonly rotations: Float32Array;
  readonly opacities: Float32Array;
  /** [count, coefficients, 3], see `GaussianCloud.sh`. */
  readonly sh: Float32Array;
  /** [count] times in seconds at which each splat has its position and its maximum opacity. */
  readonly centers: Float64Array;
  /** [count] standard deviations in seconds of the Gaussian by which each splat fades; Infinity if it does not fade. */
  readonly fades: Float64Array;
  /** [count] times in seconds from which each splat exists. */
  readonly from: Float64Array;
  /** [count] times in seconds at which each splat ceases to exist. */
  readonly until: Float64Array;
  /** [count] ids of the rigid objects that move the splats; 0 if none does. */
  readonly objects: Uint32Array;
}

export interface Scene {
  readonly header: Header;
  readonly grids: Grids;
  readonly windows: readonly (readonly [number, number])[];
  readonly name: string;
}

/**
 * Converts the integers of a state to splats.
 * @param bands Bytes of spherical harmonics, [count, 3, 2·degree + 1] for each degree above 0.
 * @throws GaussianSplatError `decode/header`, `decode/corrupt`
 */
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

/**
 * Returns the power of 2 by which the step of velocities is divided, section 6.3: splats with longer lives have smaller
 * steps.
 * @param half Seconds from the center of the life to its end.
 */
function lifeClass(half: number): number {
  const clamped = Math.min(2, Math.max(0.02, half));
  return Math.min(2, Math.max(-4, Math.ceil(Math.log2(clamped / 0.5))));
}

/** Returns the step of times in seconds, section 6.3. Splats that fade quickly have smaller steps. */
function timeStep(fade: number, step: number): number {
  const target = Math.min(step, 0.05 * fade);
  return step * 2 ** Math.min(0, Math.max(-10, Math.floor(Math.log2(target / step))));
}

/** Returns quaternions (w, x, y, z), section 6.4. The file omits the largest component of (x, y, z, w). */
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

/** Returns coefficients as in `GaussianCloud.sh`. Integers of colors are (g, r - g, b - g). */
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

/** Returns the factor of a splat's opacity at a time, 0..1: 0 outside its life, and if the factor is below `cutoff`. */
export function presence(splats: ChangingSplats, i: number, seconds: number, cutoff: number): number {
  if (!(splats.from[i] <= seconds && seconds < splats.until[i])) return 0;
  if (splats.fades[i] === Infinity) return 1;
  const share = Math.exp(-0.5 * ((seconds - splats.centers[i]) / splats.fades[i]) ** 2);
  return share >= cutoff ? share : 0;
}
