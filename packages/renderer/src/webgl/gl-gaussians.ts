import { GaussianSplatError } from '@gaussian-splat/core';
import { turn } from '../gpu/page-thread.js';
import type { PackedGaussians } from '../pack/pack.js';
import { dataWidth, makeTexture, requireMemory } from './gl.js';

/** Number of words uploaded in one step: 4 MB, a few milliseconds. */
const WORDS_AT_ONCE = 1 << 20;
/** Number of 32-bit words of a splat's geometry. The first three are its position. */
const GEOMETRY_WORDS = 8;
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

  private constructor(gl: WebGL2RenderingContext, packed: PackedGaussians) {
    this.#gl = gl;
    const { count, droppedCount, shDegree, shPrecision, antialiased, filterVariance, origin } = packed;
    this.facts = { count, droppedCount, shDegree, shPrecision, antialiased, filterVariance, origin };
    requireRoom(gl, packed);
    this.geometry = makeTexture(gl, gl.RGBA32UI, sizeOf(gl, packed.geometry.length / 4));
    this.sh = makeTexture(gl, gl.RG32UI, sizeOf(gl, packed.sh.length / 2));
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
      await write(gl, made.geometry, { format: gl.RGBA_INTEGER, texelWords: 4, words: packed.geometry }, run);
      await write(gl, made.sh, { format: gl.RG_INTEGER, texelWords: 2, words: packed.sh }, run);
      return made;
    } catch (error) {
      made.destroy();
      throw error;
    }
  }

  destroy(): void {
    this.#gl.deleteTexture(this.geometry);
    this.#gl.deleteTexture(this.sh);
  }
}

interface Content {
  readonly format: GLenum;
  readonly texelWords: number;
  readonly words: Uint32Array;
}

async function write(gl: WebGL2RenderingContext, texture: WebGLTexture, content: Content, run: RunGl): Promise<void> {
  const { format, texelWords, words } = content;
  const rowTexels = dataWidth(gl);
  const rowWords = rowTexels * texelWords;
  const rowsAtOnce = Math.floor(WORDS_AT_ONCE / rowWords);
  for (let first = 0; first < words.length;) {
    if (first > 0) await turn();
    const left = words.length - first;
    // An incomplete row is uploaded separately.
    const [width, rows] =
      left < rowWords ? [left / texelWords, 1] : [rowTexels, Math.min(rowsAtOnce, Math.floor(left / rowWords))];
    const row = first / rowWords;
    const from = first;
    run(() => {
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, width, rows, format, gl.UNSIGNED_INT, words, from);
    });
    first += width * rows * texelWords;
  }
}

function requireRoom(gl: WebGL2RenderingContext, { count, shDegree, geometry, sh }: PackedGaussians): void {
  const side = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
  const texels = Math.max(geometry.length / 4, sh.length / 2);
  const max = Math.floor((side * dataWidth(gl) * count) / texels);
  if (!(count > max) || gl.isContextLost()) return;
  throw new GaussianSplatError('out-of-memory/buffer-limit', {
    where: `scene of ${count} splats, drawn with WebGL 2`,
    expected: `at most ${max} splats with harmonics of degree ${shDegree}: textures of this browser have ${side} rows at most`,
    found: String(count),
    remedy: 'show a smaller scene (gaussian-splat optimize makes one), or use a browser with WebGPU',
  });
}
