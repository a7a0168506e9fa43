import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { checkedPart } from '../foreign-signatures.js';
import { damaged } from '../faults.js';
import type { OpenFile, SceneSource } from '../scene-format.js';
import { WebpError } from '../webp/bits.js';
import { decodeWebp, webpSize, type WebpImage } from '../webp/decode.js';
import { decodeNatively } from '../webp/native.js';

/** Maximum number of pixels of a plane beyond one for each splat: rows and columns of padding. */
const EXTRA_PIXELS = 65_536;

/** Opens the images of a SOG scene and decodes them, with limits on their size. */
export class Planes {
  readonly #open: OpenFile;
  readonly #source: SceneSource;
  readonly #loaded = new Map<string, Promise<Uint8Array>>();
  /** The last decoded image, because names may repeat. */
  #last: { readonly file: string; readonly image: WebpImage } | undefined;

  constructor(open: OpenFile, source: SceneSource) {
    this.#open = open;
    this.#source = source;
  }

  /** Downloads an image: only once for repeated names. */
  load(file: string): Promise<Uint8Array> {
    const loading = this.#loaded.get(file) ?? this.#load(file);
    this.#loaded.set(file, loading);
    return loading;
  }

  async #load(file: string): Promise<Uint8Array> {
    this.#source.signal?.throwIfAborted();
    return checkedPart(await this.#open(file), `${this.#source.name}, ${file}`);
  }

  /** A plane with one pixel for each splat: at least `count` pixels, and not many more. */
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

  /** Any image of at most `maxPixels`; its header is checked before anything is allocated. */
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
      // Pixels, and those before a transform with its own size is inverted.
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
