/** Probing points of a frame, against a walk over the same splats one by one. */
import { layouts, probeDepthStage } from '@gaussian-splat/renderer/stages';
import { check, randomSource, type Bench, type StageCase } from '../../support/gpu.js';

const ALPHA_MIN = 1 / 255;
const ALPHA_MAX = 0.999;
const { size, fields } = layouts.ProbeAnswer;
const WORDS = size / 4;

interface Splat {
  readonly x: number;
  readonly y: number;
  readonly inverseSigmaX: number;
  readonly slope: number;
  readonly inverseSigmaV: number;
  readonly opacity: number;
  readonly depth: number;
}

interface Point {
  readonly x: number;
  readonly y: number;
  readonly depth: number;
}

function randomSplats(count: number, seed: number, maxOpacity: number): Splat[] {
  const random = randomSource(seed);
  return Array.from({ length: count }, () => ({
    x: Math.fround(100 * random()),
    y: Math.fround(80 * random()),
    inverseSigmaX: Math.fround(1 / (0.5 + 20 * random())),
    slope: Math.fround(4 * (random() - 0.5)),
    inverseSigmaV: Math.fround(1 / (0.5 + 20 * random())),
    opacity: Math.fround(maxOpacity * random()),
    depth: tenDigits(0.5 + 30 * random()),
  }));
}

const floatBits = (x: number): number => new Uint32Array(Float32Array.of(x).buffer)[0];

/** A number of ten binary digits behind the first. */
const tenDigits = (x: number): number => new Float32Array(Uint32Array.of(floatBits(x) & ~0x1fff).buffer)[0];

/** As shaders/shared/splat.wgsl writes it: the upper bits of a float32 from 2⁻²⁸ on, except for codes that are no finite float16. */
function depthCode(depth: number): number {
  const steps = (floatBits(depth) - floatBits(2 ** -28)) >>> 13;
  return steps < 0x7c00 ? steps : steps + 0x400;
}

function pack(splats: readonly Splat[]): Uint32Array {
  const words = new Uint32Array((splats.length * layouts.ProjectedSplat.size) / 4);
  const floats = new Float32Array(words.buffer);
  splats.forEach((splat, i) => {
    floats.set([splat.x, splat.y, splat.inverseSigmaX, splat.slope, splat.inverseSigmaV], 8 * i);
    words[8 * i + 6] = depthCode(splat.depth) << 16;
    floats[8 * i + 7] = splat.opacity;
  });
  return words;
}

function alphaAt(splat: Splat, { x, y }: Point): number {
  const u = (x - splat.x) * splat.inverseSigmaX;
  const v = (y - splat.y - splat.slope * (x - splat.x)) * splat.inverseSigmaV;
  const alpha = Math.min(ALPHA_MAX, splat.opacity * Math.exp(-(u * u + v * v) / 2));
  return alpha < ALPHA_MIN ? 0 : alpha;
}

/** Fractions of the light that are left behind the layers of an answer. */
const LEFT = Array.from({ length: 16 }, (_, k) => (k < 9 ? 0.9 - 0.1 * k : 0.1 * 0.5 ** (k - 8)));

/** Opacity, depths or 0, transmittance in front of the point, and how near the light comes to each fraction. */
function twin(
  nearToFar: readonly Splat[],
  point: Point,
): { opacity: number; depths: number[]; inFront: number; margins: number[] } {
  let [light, inFront] = [1, 1];
  const depths = LEFT.map(() => 0);
  const margins = LEFT.map(() => Infinity);
  for (const splat of nearToFar) {
    const share = 1 - alphaAt(splat, point);
    light *= share;
    if (splat.depth < point.depth) inFront *= share;
    LEFT.forEach((left, k) => {
      if (share < 1) margins[k] = Math.min(margins[k], Math.abs(light - left));
      if (depths[k] === 0 && light < left) depths[k] = splat.depth;
    });
  }
  return { opacity: 1 - light, depths, inFront, margins };
}

async function checkProbe(bench: Bench, count: number, maxOpacity: number): Promise<void> {
  const splats = randomSplats(count, count + 1, maxOpacity);
  const order = Uint32Array.from(splats.keys()).sort((a, b) => splats[a].depth - splats[b].depth || a - b);
  const random = randomSource(count + 2);
  const points = Array.from({ length: 33 }, () => ({
    x: Math.floor(100 * random()) + 0.5,
    y: Math.floor(80 * random()) + 0.5,
    depth: Math.fround(35 * random()),
  }));
  const plan = new Uint32Array((layouts.Plan.size + layouts.PagePlan.size) / 4);
  plan[layouts.Plan.fields.visible.offset / 4] = count;
  const stage = probeDepthStage(bench.device);
  const answers = bench.buffer(points.length * layouts.ProbeAnswer.size);
  const asked = Float32Array.from(points.flatMap(({ x, y, depth }) => [x, y, depth, 0]));
  const bindings = stage.bind({
    plan: bench.buffer(plan),
    splats: bench.buffer(count > 0 ? pack(splats) : 32),
    order: bench.buffer(count > 0 ? order : 4),
    points: bench.buffer(new Uint32Array(asked.buffer)),
    answers,
  });
  bench.compute((pass) => stage.record(pass, bindings, points.length));
  const found = new Float32Array((await bench.read(answers)).buffer);
  const nearToFar = Array.from(order, (slot) => splats[slot]);
  points.forEach((point, i) => {
    const { opacity, depths, inFront, margins } = twin(nearToFar, point);
    const near = (actual: number, expected: number, what: string): void =>
      check(Math.abs(actual - expected) < 1e-5, `${what} of point ${i}: ${actual}, expected ${expected}`);
    near(found[WORDS * i + fields.opacity.offset / 4], opacity, 'opacity');
    // If the light comes within a rounding of a fraction, float32 may name the next splat.
    depths.forEach((depth, k) => {
      if (margins[k] > 1e-5) near(found[WORDS * i + k], depth, `depth at ${LEFT[k]}`);
    });
    near(found[WORDS * i + fields.in_front.offset / 4], inFront, 'transmittance in front');
  });
}

export const probeCases: readonly StageCase[] = [
  { name: 'probe: no splats at all leave every point clear', run: (bench) => checkProbe(bench, 0, 1) },
  ...[1, 63, 64, 65, 1000, 5000].flatMap((count) =>
    [0.05, 1].map((maxOpacity) => ({
      name: `probe: ${count} splats of opacity up to ${maxOpacity} have the depths of a walk one by one`,
      run: (bench: Bench) => checkProbe(bench, count, maxOpacity),
    })),
  ),
];
