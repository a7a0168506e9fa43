import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { checkedPart } from '../foreign-signatures.js';
import { damaged } from '../faults.js';
import type { OpenFile, SceneSource } from '../scene-format.js';
import { WebpError } from '../webp/bits.js';
import { decodeWebp, webpSize, type WebpImage } from '../webp/decode.js';
import { decodeNatively } from '../webp/native.js';

/** Number of pixels that a plane may have in addition to two for each splat, for rows and columns of padding. */
const EXTRA_PIXELS = 65_536;

/** Opens and decodes the images of a SOG scene, with limits on their size. */
export class Planes {
  readonly #open: OpenFile;
  readonly #source: SceneSource;
  readonly #loaded = new Map<string, Promise<Uint8Array>>();
  /** Last decoded image, which several attributes may have in common. */
  #last: { readonly file: string; readonly image: WebpImage } | undefined;

  constructor(open: OpenFile, source: SceneSource) {
    this.#open = open;
    this.#source = source;
  }

  /** Returns the bytes of an image file. Each file is downloaded once. */
  load(file: string): Promise<Uint8Array> {
    const loading = this.#loaded.get(file) ?? this.#load(file);
    this.#loaded.set(file, loading);
    return loading;
  }

  async #load(file: string): Promise<Uint8Array> {
    this.#source.signal?.throwIfAborted();
    return checkedPart(await this.#open(file), `${this.#source.name}, ${file}`);
  }

  /**
   * Decodes an image with one pixel for each of `count` splats. Throws `decode/corrupt` for fewer pixels, or many more.
   */
  async decodePlane(bytes: Uint8Array, file: string, count: number): Promise<Uint32Array> {
    const { pixels } = await this.decode(bytes, file, 2 * count + EXTRA_PIXELS);
    if (pixels.length < count) {
      throw damaged(
        `${this.#source.name}, ${file}`,
        `${grouped(count)} pixels, one for each splat`,
        grouped(pixels.length),
      );
    }
    return pixels;
  }

  /**
   * Decodes an image of at most `maxPixels` pixels. The size in its header is checked before memory is allocated.
   * @param file Path of the image, for the cache and for error messages.
   * @throws GaussianSplatError `decode/corrupt`, `decode/truncated`, `decode/unsupported`, `out-of-memory/budget`
   */
  async decode(bytes: Uint8Array, file: string, maxPixels: number): Promise<WebpImage> {
    const { signal, name, budget } = this.#source;
    signal?.throwIfAborted();
    if (this.#last?.file === file) return this.#last.image;
    const where = `${name}, ${file}`;
    const take = (bytes: number): void => budget.take(bytes, where);
    try {
      const { width, height } = webpSize(bytes);
      if (width * height > maxPixels) {
        throw damaged(where, `at most ${grouped(maxPixels)} pixels`, `${width} x ${height}`);
      }
      // Decoding needs two arrays of pixels: before and after a transform that changes the width.
      take(8 * width * height);
      const image = (await decodeNatively(bytes, { width, height })) ?? decodeWebp(bytes, take);
      this.#last = { file, image };
      return image;
    } catch (cause) {
      if (cause instanceof GaussianSplatError || !(cause instanceof WebpError)) throw cause;
      const code = cause.isForeign ? 'decode/unsupported' : cause.isCut ? 'decode/truncated' : 'decode/corrupt';
      throw damaged(where, 'a lossless WebP image', cause.message, code, cause);
    }
  }
}
