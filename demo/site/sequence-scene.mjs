/**
 * The moving scene of the examples, written when the site is built: a knot along which waves run, as a clip. All of its splats live all the time.
 */
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { deflate } from '../../packages/cli/src/lib/encoders.mjs';

const FRAMES = 24;
const FRAMES_PER_SECOND = 12;
const SPLATS = 4000;
/** The irrational step that spreads points evenly. */
const GOLDEN = (Math.sqrt(5) - 1) / 2;
/** Value of the constant spherical harmonic. */
const SH_CONSTANT = 0.28209479177387814;

/** Step sizes of rounding that the eye cannot see. */
const STEPS = { position: 0.004, rotation: 0.02, scale: 0.05, opacity: 0.02, color: 0.03 };

/** Writes `knot.gsv` into a folder. */
export async function writeSequence(folder) {
  const { codeClip, encodingsFor } = await import('../../packages/optimize/dist/index.js');
  mkdirSync(folder, { recursive: true });
  const { bytes } = await codeClip({
    ...{ frameCount: FRAMES, framesPerSecond: FRAMES_PER_SECOND, framesPerGroup: FRAMES, minPsnr: 45 },
    openFrame: async (frame) => knotAt(frame / FRAMES),
    ...{ deflate, rounding: { encoding: encodingsFor('knot.spz').at(-1), steps: STEPS } },
  });
  writeFileSync(join(folder, 'knot.gsv'), bytes);
}

/** The knot at a fraction of its period, as a `GaussianCloud`. */
function knotAt(share) {
  const cloud = {
    count: SPLATS,
    origin: [0, 0, 0],
    positions: new Float32Array(3 * SPLATS),
    scales: new Float32Array(3 * SPLATS),
    rotations: new Float32Array(4 * SPLATS),
    opacities: new Float32Array(SPLATS).fill(0.95),
    sh: new Float32Array(3 * SPLATS),
    shDegree: 0,
    antialiased: false,
    droppedCount: 0,
  };
  for (let i = 0; i < SPLATS; i++) {
    const along = 2 * Math.PI * ((i + 0.5) / SPLATS);
    const around = 2 * Math.PI * ((i * GOLDEN) % 1);
    const wave = Math.sin(3 * along - 2 * Math.PI * share) ** 2;
    const { point, tangent } = tubeAt(along, around, 0.22 + 0.14 * wave);
    cloud.positions.set(point, 3 * i);
    cloud.scales.set([0.06, 0.045, 0.03], 3 * i);
    cloud.rotations.set(turnTo(tangent), 4 * i);
    cloud.sh.set(colorAt(along, around, wave), 3 * i);
  }
  return cloud;
}

/** A point of the tube around a trefoil, and the trefoil's direction there. */
function tubeAt(along, around, radius) {
  const center = trefoil(along);
  const ahead = trefoil(along + 1e-3);
  const tangent = normalized(center.map((value, k) => ahead[k] - value));
  const side = normalized(cross(tangent, [0.3, 0.2, 1]));
  const up = cross(tangent, side);
  const [c, s] = [radius * Math.cos(around), radius * Math.sin(around)];
  return { point: center.map((value, k) => value + c * side[k] + s * up[k]), tangent };
}

const trefoil = (t) => [Math.sin(t) + 2 * Math.sin(2 * t), Math.cos(t) - 2 * Math.cos(2 * t), -Math.sin(3 * t)];
const normalized = (v) => v.map((value) => value / Math.hypot(...v));
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
/** The quaternion (w, x, y, z) that turns the first axis into a direction. */
const turnTo = ([x, y, z]) => normalized([1 + x + 1e-6, 0, -z, y]);

/** Constant coefficients of a warm color that goes to blue along the knot, lighter on top and on the wave. */
function colorAt(along, around, wave) {
  const share = 0.5 + 0.5 * Math.sin(along);
  const light = 0.62 + 0.28 * Math.sin(around) + 0.18 * wave;
  const [from, to] = [
    [0.93, 0.52, 0.2],
    [0.2, 0.45, 0.85],
  ];
  return from.map((value, k) => ((value + share * (to[k] - value)) * light - 0.5) / SH_CONSTANT);
}
