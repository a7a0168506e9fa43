/**
 * The clip of the gallery, written when the site is built: dust rises from a plate, becomes a vase, which stands for a while, and blows away. No splat lives all the time. It demonstrates clips without a file in the repository.
 */
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { deflate } from '../../packages/cli/src/lib/encoders.mjs';

const FRAMES = 150;
const FRAMES_PER_SECOND = 15;
const FRAMES_PER_GROUP = 50;
const SPLATS = 5000;
const PLATE = 700;
/** Seconds from the birth of a splat to its place, and from its leave to its end. */
const [RISE, DRIFT] = [1.4, 1.6];
/** The irrational step that spreads points evenly. */
const GOLDEN = (Math.sqrt(5) - 1) / 2;
/** Value of the constant spherical harmonic. */
const SH_CONSTANT = 0.28209479177387814;
/** Step sizes of rounding that the eye cannot see. */
const STEPS = { position: 0.004, rotation: 0.02, scale: 0.05, opacity: 0.02, color: 0.03 };

/** Writes `vase.gsv` into a folder. */
export async function writeClip(folder) {
  const { codeClip, encodingsFor } = await import('../../packages/optimize/dist/index.js');
  mkdirSync(folder, { recursive: true });
  // The encoder opens each frame several times.
  const frames = [];
  const { bytes } = await codeClip({
    ...{ frameCount: FRAMES, framesPerSecond: FRAMES_PER_SECOND, framesPerGroup: FRAMES_PER_GROUP, minPsnr: 45 },
    openFrame: async (frame) => (frames[frame] ??= vaseAt(frame / FRAMES_PER_SECOND)),
    ...{ deflate, rounding: { encoding: encodingsFor('vase.spz').at(-1), steps: STEPS } },
  });
  writeFileSync(join(folder, 'vase.gsv'), bytes);
}

const PLATE_SPLATS = Array.from({ length: PLATE }, (_, i) => plateSplat(i));

/** The vase at a time, as a `GaussianCloud`. */
function vaseAt(seconds) {
  const rising = Array.from({ length: SPLATS }, (_, i) => vaseSplat(i, seconds));
  const splats = [...PLATE_SPLATS, ...rising.filter(Boolean)];
  const flat = (width, of) => {
    const values = new Float32Array(width * splats.length);
    splats.forEach((splat, i) => values.set(of(splat), width * i));
    return values;
  };
  return {
    ...{ count: splats.length, origin: [0, 0, 0], shDegree: 0, antialiased: false, droppedCount: 0 },
    positions: flat(3, ({ position }) => position),
    scales: flat(3, ({ size }) => [size, 0.8 * size, 0.5 * size]),
    rotations: flat(4, ({ turn }) => turn),
    opacities: Float32Array.from(splats, ({ opacity }) => opacity),
    sh: flat(3, ({ color }) => color.map((value) => (value - 0.5) / SH_CONSTANT)),
  };
}

/** Up is -y, as in captures. */
function plateSplat(i) {
  const [angle, radius] = [2 * Math.PI * ((i * GOLDEN) % 1), 1.5 * Math.sqrt((i + 0.5) / PLATE)];
  const shade = 0.3 + 0.06 * Math.cos(9 * radius);
  return {
    ...{ position: [radius * Math.cos(angle), 0.02, radius * Math.sin(angle)], size: 0.055, opacity: 0.97 },
    ...{ turn: [Math.SQRT1_2, 0, 0, Math.SQRT1_2], color: [shade, 0.95 * shade, 0.9 * shade] },
  };
}

/** A splat of the vase on its way; undefined before it is there and once it is gone. The lower ones come first and go last. */
function vaseSplat(i, seconds) {
  const height = (i + 0.5) / SPLATS;
  const angle = 2 * Math.PI * ((i * GOLDEN) % 1);
  const scatter = (step) => ((i * step) % 1) - 0.5;
  const birth = 0.1 + 3.2 * height + 0.3 * scatter(0.7548776662);
  const leave = 9.2 - RISE - 2.4 * height + 0.5 * scatter(0.5698402909);
  const end = leave + DRIFT * (0.7 + 0.6 * (scatter(0.3247179572) + 0.5));
  if (seconds < birth || seconds >= end) return undefined;
  const share = Math.min(1, (seconds - birth) / RISE);
  const eased = share * share * (3 - 2 * share);
  const gone = Math.max(0, seconds - leave);
  const radius = 0.32 + 0.26 * Math.sin(2.6 * height + 0.5) + 0.05 * Math.sin(9 * height);
  const swirl = angle + 2.2 * (1 - eased);
  const reach = radius + 0.9 * (1 - eased) * (0.6 + scatter(0.4142135623));
  const wind = gone * gone;
  const stripe = Math.sin(14 * height + 3 * angle) > 0.2 ? 1 : 0;
  const light = 0.75 + 0.3 * Math.cos(angle - 0.8);
  const color = stripe ? [0.85, 0.45, 0.2] : [0.2, 0.42, 0.62];
  const fade = Math.min(1, 6 * share, (2 * (end - seconds)) / DRIFT);
  return {
    position: [
      reach * Math.cos(swirl) + 0.7 * wind + 0.3 * gone * scatter(0.8191725134),
      -(1.9 * height) * eased - 0.25 * wind * (1 + scatter(0.6710436067)),
      reach * Math.sin(swirl) + 0.3 * gone * scatter(0.5497004779),
    ],
    ...{
      size: 0.03 + 0.02 * (1 - gone / (DRIFT + 1)),
      opacity: 0.95 * fade,
      color: color.map((value) => value * light),
    },
    turn: [Math.cos(angle / 2), 0, Math.sin(angle / 2), 0],
  };
}
