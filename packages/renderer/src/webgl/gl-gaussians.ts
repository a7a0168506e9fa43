import { GaussianSplatError } from '@gaussian-splat/core';
import { turn } from '../gpu/page-thread.js';
import type { PackedGaussians } from '../pack/pack.js';
import { GEOMETRY_WORDS, shWords } from '../pack/words.js';
import { dataWidth, makeTexture, requireMemory } from './gl.js';

/** Number of words uploaded in one step: 4 MB, a few milliseconds. */
const WORDS_AT_ONCE = 1 << 20;
/** Number of words of each splat that frames write: the projected splat, and its entry in the order. */
const FRAME_WORDS = 9;

/** Properties of a scene that frames need, without its splats. */
export type GlGaussianFacts = Omit<PackedGaussians, 'geometry' | 'sh' | 'chunks' | 'details' | 'leafCount'>;

/** Returns the size of a packed scene in GPU memory, in bytes, including the data that frames keep for each splat. */
export const glBytes = ({ count, geometry, sh }: PackedGaussians): number =>
  geometry.byteLength + sh.byteLength + 4 * FRAME_WORDS * count;

/** Returns [N, 3] positions of packed splats, relative to the origin of their scene. */
export function positionsIn(geometry: Uint32Array): Float32Array<ArrayBuffer> {
  const numbers = new Float32Array(geometry.buffer, geometry.byteOffset, geometry.length);
  const positions = new Float32Array((3 * geometry.length) / GEOMETRY_WORDS);
  for (let at = 0, from = 0; at < positions.length; at += 3, from += GEOMETRY_WORDS) {
    positions[at] = numbers[from];
    positions[at + 1] = numbers[from + 1];
    positions[at + 2] = numbers[from + 2];
  }
  return positions;
}

/** Runs a function with WebGL calls synchronously, and returns its result. */
export type RunGl = <T>(work: () => T) => T;

/** Returns the width and the number of rows of a texture for a number of texels; at least one row. */
export function sizeOf(gl: WebGL2RenderingContext, texels: number): readonly [width: number, rows: number] {
  const width = dataWidth(gl);
  return [width, Math.max(1, Math.ceil(texels / width))];
}

/** Packed Gaussians of a scene in textures. */
export class GlGaussians {
  readonly facts: GlGaussianFacts;
  readonly geometry: WebGLTexture;
  readonly sh: WebGLTexture;
  readonly #gl: WebGL2RenderingContext;
  /** Layouts of the geometry and of the harmonics. */
  readonly #layouts: readonly Layout[];

  /**
   * Allocates textures for `count` splats, which {@link write} fills.
   * @throws GaussianSplatError `out-of-memory/buffer-limit` for more splats than textures can hold.
   */
  constructor(gl: WebGL2RenderingContext, facts: GlGaussianFacts) {
    this.#gl = gl;
    const { count, droppedCount, shDegree, shPrecision, antialiased, filterVariance, origin } = facts;
    this.facts = { count, droppedCount, shDegree, shPrecision, antialiased, filterVariance, origin };
    const texels = [(GEOMETRY_WORDS * count) / 4, (shWords(shDegree, shPrecision) * count) / 2] as const;
    requireRoom(gl, this.facts, Math.max(...texels));
    this.geometry = makeTexture(gl, gl.RGBA32UI, sizeOf(gl, texels[0]));
    this.sh = makeTexture(gl, gl.RG32UI, sizeOf(gl, texels[1]));
    this.#layouts = [
      { texture: this.geometry, format: gl.RGBA_INTEGER, texelWords: 4, splatWords: GEOMETRY_WORDS },
      { texture: this.sh, format: gl.RG_INTEGER, texelWords: 2, splatWords: shWords(shDegree, shPrecision) },
    ];
  }

  /**
   * Uploads packed Gaussians to the GPU, in parts, so that other tasks of the thread can run in between.
   * @param run Runs each part: `GlHost.run` in a context that the renderer shares with other code.
   * @throws GaussianSplatError `out-of-memory/buffer-limit` for more splats than textures can hold;
   * `out-of-memory/allocation` if the device has too little memory.
   */
  static async upload(
    gl: WebGL2RenderingContext,
    packed: PackedGaussians,
    run: RunGl = (work) => work(),
  ): Promise<GlGaussians> {
    const made = run(() => new GlGaussians(gl, packed));
    try {
      requireMemory(gl, `scene of ${packed.count} splats`);
      for (const [k, words] of [packed.geometry, packed.sh].entries())
        for (const [n, part] of made.#parts(k, 0, words).entries()) {
          if (n > 0) await turn();
          run(part);
        }
      return made;
    } catch (error) {
      made.destroy();
      throw error;
    }
  }

  /** Replaces splats from index `first` on. */
  write(first: number, geometry: Uint32Array, sh: Uint32Array): void {
    for (const [k, words] of [geometry, sh].entries()) for (const part of this.#parts(k, first, words)) part();
  }

  destroy(): void {
    this.#gl.deleteTexture(this.geometry);
    this.#gl.deleteTexture(this.sh);
  }

  /** Returns calls that write words from splat `first` on, in rectangles of whole rows or parts of one. */
  #parts(k: number, first: number, words: Uint32Array): (() => void)[] {
    const gl = this.#gl;
    const { texture, format, texelWords, splatWords } = this.#layouts[k];
    const rowTexels = dataWidth(gl);
    const rowsAtOnce = Math.floor(WORDS_AT_ONCE / (rowTexels * texelWords));
    const parts: (() => void)[] = [];
    for (let from = 0; from < words.length;) {
      const [at, left] = [(first * splatWords + from) / texelWords, (words.length - from) / texelWords];
      const [x, y] = [at % rowTexels, Math.floor(at / rowTexels)];
      const [width, rows] =
        x > 0 || left < rowTexels
          ? [Math.min(left, rowTexels - x), 1]
          : [rowTexels, Math.min(rowsAtOnce, Math.floor(left / rowTexels))];
      const begin = from;
      parts.push(() => {
        gl.activeTexture(gl.TEXTURE0);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, x, y, width, rows, format, gl.UNSIGNED_INT, words, begin);
      });
      from += width * rows * texelWords;
    }
    return parts;
  }
}

/** A texture with words of each splat. */
interface Layout {
  readonly texture: WebGLTexture;
  readonly format: GLenum;
  readonly texelWords: number;
  readonly splatWords: number;
}

function requireRoom(gl: WebGL2RenderingContext, { count, shDegree }: GlGaussianFacts, texels: number): void {
  const side = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
  const max = Math.floor((side * dataWidth(gl) * count) / texels);
  if (!(count > max) || gl.isContextLost()) return;
  throw new GaussianSplatError('out-of-memory/buffer-limit', {
    where: `scene of ${count} splats, drawn with WebGL 2`,
    expected: `at most ${max} splats with harmonics of degree ${shDegree}: textures of this browser have ${side} rows at most`,
    found: String(count),
    remedy: 'show a smaller scene (gaussian-splat optimize makes one), or use a browser with WebGPU',
  });
}
