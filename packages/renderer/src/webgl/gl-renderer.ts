import { SPLAT_FILTERS, validateCamera, type Camera, type ShDegree, type SplatFilter } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint } from '../depth-probe.js';
import { constants, type layouts } from '../generated/shaders.js';
import type { StructValues } from '../gpu/struct.js';
import type { Rgba } from '../frame-target.js';
import type { AccumulationFormat } from '../rasterizers/rasterizer.js';
import { cameraValues, MAX_FLOAT32, resized, scaled } from '../view.js';
import { makeTarget, makeTexture, requireMemory } from './gl.js';
import { sizeOf, type GlGaussians } from './gl-gaussians.js';
import { probeSplats } from './gl-probe.js';
import { GlPrograms } from './gl-programs.js';
import { readTexels } from './read-texels.js';
import { SH_PRECISION } from '../pack/words.js';

const { QUAD_BATCH } = constants;
/** Number of indices of the two triangles of a quad. */
const INDICES_PER_QUAD = 6;
const TRANSPARENT: Rgba = [0, 0, 0, 0];
/** Upper corner of a crop that contains everything; the lower corner is its negative. */
const EVERYWHERE = [MAX_FLOAT32, MAX_FLOAT32, MAX_FLOAT32];

/** Formats into which splats are blended: `rgba8unorm` only if the browser cannot blend floats. */
export type GlAccumulationFormat = AccumulationFormat | 'rgba8unorm';

const BYTES_PER_PIXEL: Record<GlAccumulationFormat, number> = { rgba8unorm: 4, rgba16float: 8, rgba32float: 16 };

/** An image to draw with WebGL. */
export interface GlFrameRequest {
  /** Camera, whose width and height must be those of the canvas. */
  readonly camera: Camera;
  /**
   * Cameras for each of several scenes, which differ in the position of their scene alone. Default: `camera` for all.
   */
  readonly cameras?: readonly Camera[] | undefined;
  /** Maximum degree of spherical harmonics to evaluate. */
  readonly shDegree: ShDegree;
  /** Low-pass filter that overrides that of the scene. */
  readonly filter?: SplatFilter | undefined;
  /** Precision of blending. `rgba32float` applies only if the browser can blend it. */
  readonly accumulation: AccumulationFormat;
  /** Fraction of the canvas's width and height that is rendered, above 0 and at most 1. */
  readonly resolutionScale: number;
  /**
   * Number of the farthest splats that earlier calls for this frame have drawn. Default: 0. An expensive frame can be
   * drawn in parts, so that other frames are drawn in between.
   */
  readonly from?: number | undefined;
  /** Maximum number of splats to draw. Default: all. */
  readonly atMost?: number | undefined;
}

/** A rectangle of a framebuffer, as large as the camera's image. */
export interface GlFrameTarget {
  /** Framebuffer, or null for the canvas. Default: the canvas. */
  readonly framebuffer?: WebGLFramebuffer | null | undefined;
  /** Distance from the left edge of the framebuffer to the rectangle, in pixels. Default: 0. */
  readonly x?: number | undefined;
  /** Distance from the bottom edge of the framebuffer to the rectangle, in pixels. Default: 0. */
  readonly y?: number | undefined;
  /** Whether to blend the splats over the content of the framebuffer instead of a background. Default: false. */
  readonly keeps?: boolean | undefined;
}

/** Program that replaces the renderer's own program for quads. */
export interface GlQuads {
  /** Makes the program current, and sets its uniforms and textures for a frame. */
  use(frame: GlQuadsFrame): void;
}

export interface GlQuadsFrame {
  /** Camera whose width and height are those of the rendered image. */
  readonly camera: Camera;
  /** Number of splats to draw: the first elements of the order texture. */
  readonly count: number;
  /** Textures of shapes, paints and order. */
  readonly textures: readonly WebGLTexture[];
}

/** Texture into which splats are blended. */
interface Accumulation {
  readonly texture: WebGLTexture;
  readonly target: WebGLFramebuffer;
  readonly format: GlAccumulationFormat;
  readonly width: number;
  readonly height: number;
}

/** Returns the most precise format that a browser can blend, up to the requested one. */
export function blendable(gl: WebGL2RenderingContext, wanted: AccumulationFormat): GlAccumulationFormat {
  const float = gl.getExtension('EXT_color_buffer_float');
  if (wanted === 'rgba32float' && float && gl.getExtension('EXT_float_blend')) return wanted;
  return float || gl.getExtension('EXT_color_buffer_half_float') ? 'rgba16float' : 'rgba8unorm';
}

/** A scene of a renderer, and the row of the textures where its splats begin. */
interface Part {
  readonly gaussians: GlGaussians;
  readonly row: number;
}

/**
 * Returns the index of the first splat of each scene in the order of a renderer, and the number of indices.
 * @param counts Splats of each scene.
 */
export function firstSplats(gl: WebGL2RenderingContext, counts: readonly number[]): { first: number[]; count: number } {
  const first: number[] = [];
  let count = 0;
  for (const own of counts) {
    first.push(count);
    const [width, rows] = sizeOf(gl, own);
    count += width * rows;
  }
  return { first, count };
}

/**
 * Draws one scene, or several in one order, with WebGL 2, with the shaders of WebGPU. Each splat is projected once to two textures. It is then
 * drawn as a quad in an order that the caller computes (`SplatOrder`), blended, and composed onto the canvas.
 */
export class GlRenderer {
  readonly #gl: WebGL2RenderingContext;
  readonly #parts: readonly Part[];
  /** Width and rows of the textures that hold the splats of all scenes. */
  readonly #size: readonly [width: number, rows: number];
  readonly #programs: GlPrograms;
  /** Uniforms of the last projection for each scene; empty before the first. */
  #views: readonly StructValues<typeof layouts.View>[] = [];
  readonly #corners: WebGLVertexArrayObject;
  readonly #indices: WebGLBuffer;
  readonly #shapes: WebGLTexture;
  readonly #paints: WebGLTexture;
  readonly #order: WebGLTexture;
  readonly #splats: WebGLFramebuffer;
  /** Number of splats in the order. */
  #count = 0;
  #accumulation: Accumulation | undefined;
  /** Cameras of the last frame, at its displayed and at its rendered size; undefined before the first. */
  #last: { readonly camera: Camera; readonly drawn: Camera } | undefined;
  /** Key of the parameters of the last projection, which is reused while they are equal. */
  #projected = '';

  /**
   * Resolves when the shaders of a context are compiled. Other tasks run meanwhile. Without this call the constructor
   * blocks the thread.
   */
  static prepare(gl: WebGL2RenderingContext): Promise<void> {
    return GlPrograms.of(gl).compiled();
  }

  /**
   * @throws GaussianSplatError `unsupported/webgl` if the browser does not compile the shaders;
   * `out-of-memory/allocation` if the device has too little memory.
   */
  constructor(gl: WebGL2RenderingContext, ...scenes: readonly GlGaussians[]) {
    this.#gl = gl;
    const counts = scenes.map(({ facts }) => facts.count);
    const { first, count } = firstSplats(gl, counts);
    const size = (this.#size = sizeOf(gl, count));
    this.#parts = scenes.map((gaussians, k) => ({ gaussians, row: first[k] / size[0] }));
    this.#programs = GlPrograms.of(gl).check();
    [this.#corners, this.#indices] = makeCorners(gl);
    this.#shapes = makeTexture(gl, gl.RGBA32UI, size);
    this.#paints = makeTexture(gl, gl.RGBA32UI, size);
    this.#order = makeTexture(gl, gl.R32UI, size);
    this.#splats = makeTarget(gl, [this.#shapes, this.#paints]);
    requireMemory(gl, `scene of ${counts.join(' and ')} splats`);
  }

  /** Bytes of GPU memory of the accumulation texture, without the splats. */
  get byteLength(): number {
    const { format, width, height } = this.#accumulation ?? { format: 'rgba8unorm', width: 0, height: 0 };
    return BYTES_PER_PIXEL[format] * width * height;
  }

  /**
   * Sets the order for subsequent frames.
   * @param order Indices of splats from near to far, in whole rows of `DATA_WIDTH`.
   * @param count Number of valid indices.
   */
  setOrder(order: Uint32Array, count: number): void {
    const gl = this.#gl;
    this.#count = count;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#order);
    const [width, rows] = sizeOf(gl, count);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, order);
  }

  /** Projects all splats again in the next frame, because the content of a scene has changed. */
  splatsChanged(): void {
    this.#projected = '';
  }

  /**
   * Draws one frame, or a part of it, into the accumulation texture: call {@link present} afterwards.
   * @param quads Program that replaces the renderer's own program for quads. It draws whole frames.
   * @returns `from` of the next part; at least the number of splats in the order if there is none.
   * @throws GaussianSplatError `argument/camera` for a camera out of range; `out-of-memory/allocation` if the device
   * has too little memory.
   */
  render(request: GlFrameRequest, quads?: GlQuads): number {
    const { camera, accumulation, resolutionScale } = request;
    validateCamera(camera);
    const drawn = scaled(camera, resolutionScale);
    // Allocates first, because the query for failed allocations waits for all earlier commands.
    const { target } = this.#accumulationOf(camera, accumulation);
    this.#projectSplats(request, drawn);
    this.#last = { camera, drawn };
    return this.#drawQuads(target, { ...request, camera: drawn }, quads);
  }

  /**
   * Composes the last frame onto the canvas, from its lower left corner, or into another target. Does nothing before
   * the first frame.
   * @param background Background color, premultiplied.
   */
  present(
    background: Rgba = TRANSPARENT,
    { framebuffer = null, x = 0, y = 0, keeps = false }: GlFrameTarget = {},
  ): void {
    if (this.#last === undefined || this.#accumulation === undefined) return;
    const { camera, drawn } = this.#last;
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.viewport(x, y, camera.width, camera.height);
    if (keeps) {
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    } else gl.disable(gl.BLEND);
    const scale = [drawn.width / camera.width, drawn.height / camera.height];
    const used = [drawn.width, drawn.height];
    this.#programs.compose.use({ background, scale, used }, [this.#accumulation.texture]);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /**
   * Probes points of the last frame, as `Viewpoint.probe` does. Later frames may be drawn before the answer arrives.
   * Rejects if the context is lost.
   * @returns An answer for each point; empty before the first frame.
   */
  async probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    if (this.#last === undefined) return [];
    const { camera, drawn } = this.#last;
    const [across, down] = [drawn.width / camera.width, drawn.height / camera.height];
    const inDrawn = points.map(({ x, y, depth }) => ({ x: across * x, y: down * y, depth }));
    const source = {
      gl: this.#gl,
      programs: this.#programs.probe,
      scenes: this.#views.map((view, k) => ({ view, geometry: this.#parts[k].gaussians.geometry })),
      textures: this.#splatTextures,
      order: this.#order,
      count: this.#count,
    };
    return probeSplats(source, inDrawn);
  }

  /** Returns the number of splats drawn in the last frame. Reads all splats back: call it for panels. */
  async countDrawn(): Promise<number> {
    const words = await readTexels(this.#gl, this.#splats, this.#size, 1);
    let count = 0;
    // The last word of a splat is its opacity.
    for (let at = 3; at < words.length; at += 4) if (words[at] !== 0) count++;
    return count;
  }

  /**
   * Frees the GPU memory of the renderer. The Gaussians, and the programs that the scenes of the context share, remain.
   */
  destroy(): void {
    const gl = this.#gl;
    for (const texture of [...this.#splatTextures, this.#accumulation?.texture]) gl.deleteTexture(texture ?? null);
    for (const target of [this.#splats, this.#accumulation?.target]) gl.deleteFramebuffer(target ?? null);
    gl.deleteVertexArray(this.#corners);
    gl.deleteBuffer(this.#indices);
  }

  get #splatTextures(): readonly WebGLTexture[] {
    return [this.#shapes, this.#paints, this.#order];
  }

  #projectSplats({ camera: whole, cameras, shDegree, filter }: GlFrameRequest, { width, height }: Camera): void {
    const what = JSON.stringify([whole, cameras, width, height, shDegree, filter]);
    if (what === this.#projected) return;
    this.#projected = what;
    const gl = this.#gl;
    const pixelArea = (width * height) / (whole.width * whole.height);
    this.#views = this.#parts.map(({ gaussians: { facts }, row }, page) => {
      const drawn = resized(cameras?.[page] ?? whole, width, height);
      const { antialiased, filterVariance = constants.DILATION } = filter ? SPLAT_FILTERS[filter] : facts;
      return {
        ...cameraValues(drawn, facts.origin, filterVariance * pixelArea),
        ...{ splat_count: facts.count, page, first_group: row },
        ...{ sh_degree: facts.shDegree, sh_cap: shDegree, sh_encoding: SH_PRECISION[facts.shPrecision] },
        ...{ antialiased: antialiased ? 1 : 0, key_bits: 32 },
        ...{ has_detail: 0, detail: 0, detail_fade: 0, splat_budget: 0 },
        ...{ opacity: 1, crop_low: EVERYWHERE.map((side) => -side), crop_high: EVERYWHERE },
      };
    });
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#splats);
    gl.disable(gl.BLEND);
    for (const [k, { gaussians, row }] of this.#parts.entries()) {
      gl.viewport(0, row, ...sizeOf(gl, gaussians.facts.count));
      this.#programs.project.use(this.#views[k], [gaussians.geometry, gaussians.sh]);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
  }

  #drawQuads(target: WebGLFramebuffer, request: GlFrameRequest, quads?: GlQuads): number {
    const gl = this.#gl;
    const { camera, from = 0 } = request;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.viewport(0, 0, camera.width, camera.height);
    // Clears to black with full transmittance.
    if (from === 0) gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 1]);
    return this.#count > from ? this.#blendQuads(request, quads) : this.#count;
  }

  #blendQuads({ camera, from = 0, atMost = Infinity }: GlFrameRequest, quads?: GlQuads): number {
    const gl = this.#gl;
    const { width, height } = camera;
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.ONE, gl.ONE_MINUS_SRC_ALPHA, gl.ZERO, gl.ONE_MINUS_SRC_ALPHA);
    const [count, textures] = [this.#count, this.#splatTextures];
    if (quads) quads.use({ camera, count, textures });
    else this.#programs.quads.use({ viewport: [width, height], count, first: from }, textures);
    gl.bindVertexArray(this.#corners);
    // One incomplete batch, or complete ones. Quads beyond the last splat are invisible.
    const wanted = Math.min(count - from, Math.max(1, atMost));
    const inBatch = wanted < count - from ? Math.min(wanted, QUAD_BATCH) : QUAD_BATCH;
    const batches = wanted < count - from ? Math.floor(wanted / inBatch) : Math.ceil(wanted / inBatch);
    gl.drawElementsInstanced(gl.TRIANGLES, inBatch * INDICES_PER_QUAD, gl.UNSIGNED_SHORT, 0, batches);
    gl.bindVertexArray(null);
    return from + batches * inBatch;
  }

  /**
   * Returns the accumulation texture. It has the size of the canvas at any resolution scale, so that nothing is
   * allocated while only the camera moves.
   */
  #accumulationOf({ width, height }: Camera, wanted: AccumulationFormat): Accumulation {
    const gl = this.#gl;
    const format = blendable(gl, wanted);
    const old = this.#accumulation;
    if (old?.width === width && old.height === height && old.format === format) return old;
    if (old) {
      gl.deleteFramebuffer(old.target);
      gl.deleteTexture(old.texture);
    }
    const names = { rgba8unorm: gl.RGBA8, rgba16float: gl.RGBA16F, rgba32float: gl.RGBA32F };
    const texture = makeTexture(gl, names[format], [width, height]);
    requireMemory(gl, `frame of ${width} x ${height} pixels`);
    return (this.#accumulation = { texture, target: makeTarget(gl, [texture]), format, width, height });
  }
}

/**
 * Creates the vertex array and the indices for a batch of quads: each has the triangles 0, 1, 2 and 2, 1, 3 of its
 * corners.
 */
function makeCorners(gl: WebGL2RenderingContext): [WebGLVertexArrayObject, WebGLBuffer] {
  const corners = gl.createVertexArray();
  const indices = gl.createBuffer();
  gl.bindVertexArray(corners);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
  const numbers = Uint16Array.from(
    { length: QUAD_BATCH * INDICES_PER_QUAD },
    (_, i) => 4 * Math.floor(i / INDICES_PER_QUAD) + [0, 1, 2, 2, 1, 3][i % INDICES_PER_QUAD],
  );
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return [corners, indices];
}
