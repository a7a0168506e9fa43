/**
 * Finds the splats at points of the last frame. Shaders search the order of splats: each search divides a range of ranks
 * into runs, and finds the run in which a fraction of the light is lost. All passes are issued at once, so that they see the
 * same frame, and only the answers are read back.
 */
import type { ProbeAnswer, ProbePoint } from '../depth-probe.js';
import { constants, type layouts } from '../generated/shaders.js';
import type { StructValues } from '../gpu/struct.js';
import type { ProbePrograms } from './gl-programs.js';
import { depthsOf } from '../probe-depths.js';
import { makeTarget, makeTexture } from './gl.js';
import { readTexels } from './read-texels.js';

/** Number of runs of a range, as in `shaders/webgl/probe_range.wgsl`; each run is one fragment. */
const RUNS = 1024;
/** Fractions of the light that `shaders/webgl/probe_cross.wgsl` searches for. */
const { PROBE_LEVELS, PROBE_MIDDLE } = constants;
/** Maximum number of points in one pass, which has a row of a texture for each point and fraction. */
const MAX_POINTS = 1024 / PROBE_LEVELS;
/** Replaces infinities, because GLSL compilers may assume that there are none. */
const MAX_FLOAT32 = 3.4e38;

/** Answer for a frame without splats. */
const NOTHING: ProbeAnswer = {
  ...depthsOf(new Float32Array(PROBE_LEVELS)),
  layers: new Float32Array(PROBE_LEVELS),
  opacity: 0,
  thickness: 0,
  transmittance: 1,
  splat: null,
};

export interface GlProbeSource {
  readonly gl: WebGL2RenderingContext;
  readonly programs: ProbePrograms;
  /** Geometry of each scene, and uniforms of the frame's projection. */
  readonly scenes: readonly { readonly view: StructValues<typeof layouts.View>; readonly geometry: WebGLTexture }[];
  /** Textures of projected shapes, paints, and the order from near to far. */
  readonly textures: readonly WebGLTexture[];
  readonly order: WebGLTexture;
  /** Number of splats in the order. */
  readonly count: number;
}

/**
 * Probes points of the last frame, and returns an answer for each. Later frames may be drawn meanwhile. Rejects if the
 * context is lost.
 */
export async function probeSplats(source: GlProbeSource, points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
  if (source.count === 0) return points.map(() => NOTHING);
  const groups: Promise<ProbeAnswer[]>[] = [];
  for (let at = 0; at < points.length; at += MAX_POINTS)
    groups.push(probeGroup(source, points.slice(at, at + MAX_POINTS)));
  return (await Promise.all(groups)).flat();
}

async function probeGroup(source: GlProbeSource, points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
  const { gl } = source;
  const made: { texture: WebGLTexture; target?: WebGLFramebuffer }[] = [];
  const size = [points.length, PROBE_LEVELS + 1] as const;
  try {
    const words = readTexels(gl, draw(source, points, made), size);
    return answersOf(await words, points.length);
  } finally {
    for (const { texture, target } of made) {
      gl.deleteFramebuffer(target ?? null);
      gl.deleteTexture(texture);
    }
  }
}

/**
 * Issues all passes for some points. Returns the framebuffer of the answers: a row for each fraction of the light, and one with
 * the light that all splats leave.
 * @param made Receives the textures and framebuffers that the caller must delete.
 */
function draw(
  { gl, programs, scenes, textures, order, count }: GlProbeSource,
  points: readonly ProbePoint[],
  made: { texture: WebGLTexture; target?: WebGLFramebuffer }[],
): WebGLFramebuffer {
  const asked = makeTexture(gl, gl.RGBA32UI, [points.length, 1]);
  made.push({ texture: asked });
  const numbers = Float32Array.from(
    points.flatMap(({ x, y, depth = MAX_FLOAT32 }) => [x, y, Math.min(depth, MAX_FLOAT32), 0]),
  );
  const bits = new Uint32Array(numbers.buffer);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, points.length, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, bits);
  gl.disable(gl.BLEND);
  /** Fills a new texture of integers with programs, and returns it with its framebuffer. */
  const fill = (
    width: number,
    height: number,
    ...uses: (() => void)[]
  ): { texture: WebGLTexture; target: WebGLFramebuffer } => {
    const texture = makeTexture(gl, gl.RGBA32UI, [width, height]);
    const target = makeTarget(gl, [texture]);
    made.push({ texture, target });
    gl.viewport(0, 0, width, height);
    for (const use of uses) {
      use();
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    return { texture, target };
  };
  // Not read by the first search; a sampler without a texture would be an error.
  let ranges = asked;
  for (let [span, isFirst] = [count, true]; isFirst || span > 1; isFirst = false) {
    // The whole range, with all of its light.
    const whole = isFirst ? [0, count, new Uint32Array(Float32Array.of(1).buffer)[0], 0] : [0, 0, 0, 0];
    const rows = isFirst ? points.length : PROBE_LEVELS * points.length;
    const from = ranges;
    const runs = fill(RUNS, rows, () => programs.runs.use({ whole }, [...textures, asked, from])).texture;
    const use = (): void => programs.cross.use({ whole }, [runs, from]);
    ranges = fill(points.length, PROBE_LEVELS + 1, use).texture;
    span = Math.ceil(span / RUNS);
  }
  const uses = scenes.map(
    ({ view, geometry }) =>
      () =>
        programs.surface.use(view, [geometry, order, asked, ranges]),
  );
  return fill(points.length, PROBE_LEVELS + 1, ...uses).target;
}

function answersOf(words: Uint32Array, points: number): ProbeAnswer[] {
  const numbers = new Float32Array(words.buffer);
  const at = (row: number, point: number): number => 4 * (row * points + point);
  return Array.from({ length: points }, (_, i) => {
    const layers = Float32Array.from({ length: PROBE_LEVELS }, (_, row) => numbers[at(row, i)]);
    const [light, transmittance] = numbers.subarray(at(PROBE_LEVELS, i));
    const [, index, sceneAfter] = words.subarray(at(PROBE_MIDDLE, i));
    const thickness = numbers[at(PROBE_MIDDLE, i) + 3];
    const splat = sceneAfter === 0 ? null : { placement: undefined, scene: sceneAfter - 1, index };
    return { opacity: 1 - light, ...depthsOf(layers), layers, thickness, transmittance, splat };
  });
}
