/**
 * Finds the splats at points of the last frame: shaders compute the transmittance of runs of splats, which the CPU
 * joins.
 */
import type { ProbeAnswer, ProbePoint } from '../depth-probe.js';
import { makeTarget, makeTexture, type GlProgram } from './gl.js';
import type { ProbeView } from './shaders.js';

/** Number of runs for each point; each run is one fragment. */
const RUNS = 1024;
/** Maximum number of points in one pass. */
const MAX_POINTS = 256;
const NUMBERS = 4;
/** Replaces infinities, because GLSL compilers may assume that there are none. */
const MAX_FLOAT32 = 3.4e38;

export interface GlProbeSource {
  readonly gl: WebGL2RenderingContext;
  readonly program: GlProgram<typeof ProbeView>;
  /** Textures of projected shapes, paints, and the order from near to far. */
  readonly textures: readonly WebGLTexture[];
  /** Number of splats in the order. */
  readonly count: number;
  /** Binds the program that finds surfaces, with a texture of queries: see shaders/webgl/probe_surface.wgsl. */
  useSurface(asked: WebGLTexture): void;
}

/** Range of ranks, which are positions in the order, to search for a point. */
interface Range {
  readonly first: number;
  readonly end: number;
}

/** Fractions of the light that are left behind the near, the middle and the far depth of an answer. */
const LEFT = [0.9, 0.5, 0.1] as const;

/**
 * Probes points of the last frame, and returns an answer for each. Waits for the GPU, so that all passes use the same
 * frame: call it for clicks and labels, not for every frame.
 */
export function probeSplats(source: GlProbeSource, points: readonly ProbePoint[]): ProbeAnswer[] {
  if (points.length > MAX_POINTS) {
    const first = probeSplats(source, points.slice(0, MAX_POINTS));
    return [...first, ...probeSplats(source, points.slice(MAX_POINTS))];
  }
  if (points.length === 0) return [];
  const { count } = source;
  const whole = points.map((): Range => ({ first: 0, end: count }));
  const rows = lookAt(source, points, whole);
  const ranks = LEFT.map((share) => ranksAt(source, points, whole, rows, share));
  const [near, middle, far] = surfacesOf(source, points, ranks);
  return rows.map((row, i) => ({
    opacity: 1 - product(row, 0),
    transmittance: product(row, 1),
    ...{ near: near[i]?.depth ?? null, depth: middle[i]?.depth ?? null, far: far[i]?.depth ?? null },
    splat: middle[i] && { placement: undefined, index: middle[i].index },
  }));
}

/**
 * Returns, for each point, the rank of the first splat behind which less than a fraction of the light is left; null if
 * none. Runs that contain this splat are subdivided until each run is one splat.
 */
function ranksAt(
  source: GlProbeSource,
  points: readonly ProbePoint[],
  ranges: readonly Range[],
  rows: readonly Float32Array[],
  share: number,
): (number | null)[] {
  let [current, found] = [ranges, rows];
  const before = points.map(() => 1);
  const crossings = points.map((_, i) => crossing(rows[i], 1, share));
  if (crossings.every((place) => place === null)) return points.map(() => null);
  while (current.some(({ first, end }) => runOf(first, end) > 1)) {
    current = current.map(({ first, end }, i) => {
      const run = runOf(first, end);
      const { at, light } = crossings[i] ?? { at: 0, light: 1 };
      before[i] = light;
      return { first: first + at * run, end: Math.min(end, first + (at + 1) * run) };
    });
    found = lookAt(source, points, current);
    current.forEach((_, i) => (crossings[i] &&= crossing(found[i], before[i], share)));
  }
  return crossings.map((place, i) => (place === null ? null : current[i].first + place.at));
}

/** A splat, and its depth of highest density along the ray of a point. */
interface Surface {
  readonly depth: number;
  readonly index: number;
}

/**
 * Returns the splat at each given rank, and its depth along the ray of its point; null for no rank. A shader computes
 * each splat in one fragment.
 */
function surfacesOf(
  { gl, useSurface }: GlProbeSource,
  points: readonly ProbePoint[],
  ranks: readonly (readonly (number | null)[])[],
): (Surface | null)[][] {
  const width = points.length * ranks.length;
  const words = new Uint32Array(4 * width);
  const numbers = new Float32Array(words.buffer);
  ranks.forEach((row, k) =>
    points.forEach(({ x, y }, i) => {
      const at = 4 * (k * points.length + i);
      numbers.set([x, y], at);
      words[at + 2] = row[i] ?? 0;
    }),
  );
  const asked = makeTexture(gl, gl.RGBA32UI, [width, 1]);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
  const texture = makeTexture(gl, gl.RGBA32UI, [width, 1]);
  const target = makeTarget(gl, [texture]);
  try {
    gl.disable(gl.BLEND);
    useSurface(asked);
    gl.viewport(0, 0, width, 1);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.readPixels(0, 0, width, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    return ranks.map((row, k) =>
      row.map((rank, i) => {
        const at = 4 * (k * points.length + i);
        return rank === null ? null : { depth: numbers[at], index: words[at + 1] };
      }),
    );
  } finally {
    gl.deleteFramebuffer(target);
    gl.deleteTexture(texture);
    gl.deleteTexture(asked);
  }
}

const runOf = (first: number, end: number): number => Math.max(1, Math.ceil((end - first) / RUNS));

function product(row: Float32Array, number: number): number {
  let result = 1;
  for (let at = number; at < row.length; at += NUMBERS) result *= row[at];
  return result;
}

/**
 * Returns the first run behind which less than a fraction of the light is left, and the light in front of this run;
 * null if none.
 */
function crossing(row: Float32Array, before: number, share: number): { at: number; light: number } | null {
  let light = before;
  for (let at = 0; at < RUNS; at++) {
    const after = light * row[NUMBERS * at];
    if (after < share) return { at, light };
    light = after;
  }
  return null;
}

/**
 * Computes the runs of all points, one row of pixels for each point. Returns the transmittance of each run, and that of
 * its splats in front of the point.
 */
function lookAt(
  { gl, program, textures }: GlProbeSource,
  points: readonly ProbePoint[],
  ranges: readonly Range[],
): Float32Array[] {
  const texture = makeTexture(gl, gl.RGBA32UI, [RUNS, points.length]);
  const target = makeTarget(gl, [texture]);
  try {
    gl.disable(gl.BLEND);
    points.forEach(({ x, y, depth = MAX_FLOAT32 }, row) => {
      const { first, end } = ranges[row];
      const point = [x, y, Math.min(depth, MAX_FLOAT32)];
      program.use({ point, first, end, run: runOf(first, end) }, textures);
      gl.viewport(0, row, RUNS, 1);
      // Draws a triangle larger than the target, scissored to the row.
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(0, row, RUNS, 1);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    });
    gl.disable(gl.SCISSOR_TEST);
    const words = new Uint32Array(NUMBERS * RUNS * points.length);
    gl.readPixels(0, 0, RUNS, points.length, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    const numbers = new Float32Array(words.buffer);
    return points.map((_, row) => numbers.subarray(NUMBERS * RUNS * row, NUMBERS * RUNS * (row + 1)));
  } finally {
    gl.deleteFramebuffer(target);
    gl.deleteTexture(texture);
  }
}
