import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { checkedPart } from '../checked-part.js';
import { damaged } from '../damaged.js';
import type { OpenPart } from '../scene-format.js';
import { decodeWebp, webpSize, type WebpImage } from '../webp/decode.js';
import { WebpError } from '../webp/webp-error.js';

/** Pixels that a plane may have beyond one for each splat: rows and columns that only fill a rectangle. */
const SPARE_PIXELS = 65_536;

/** Opens the images of a SOG scene and decodes them, with bounds on what they may take. */
export class Planes {
  readonly #open: OpenPart;
  readonly #name: string;
  readonly #signal: AbortSignal | undefined;

  constructor(open: OpenPart, name: string, signal: AbortSignal | undefined) {
    this.#open = open;
    this.#name = name;
    this.#signal = signal;
  }

  /** Downloads an image. */
  async load(file: string): Promise<Uint8Array> {
    this.#signal?.throwIfAborted();
    return checkedPart(await this.#open(file), `${this.#name}, ${file}`);
  }

  /** A plane with one pixel for each splat: at least `count` pixels, and not many more. */
  decodePlane(bytes: Uint8Array, file: string, count: number): Uint32Array {
    const { pixels } = this.decode(bytes, file, 2 * count + SPARE_PIXELS);
    if (pixels.length < count) {
      throw damaged(`${this.#name}, ${file}`, `${grouped(count)} pixels, one for each splat`, grouped(pixels.length));
    }
    return pixels;
  }

  /** Any image of at most `maxPixels`; its header is asked before anything is allocated. */
  decode(bytes: Uint8Array, file: string, maxPixels: number): WebpImage {
    this.#signal?.throwIfAborted();
    const where = `${this.#name}, ${file}`;
    try {
      const { width, height } = webpSize(bytes);
      if (width * height > maxPixels) {
        throw damaged(where, `at most ${grouped(maxPixels)} pixels`, `${width} x ${height}`);
      }
      return decodeWebp(bytes);
    } catch (cause) {
      if (cause instanceof GaussianSplatError || !(cause instanceof WebpError)) throw cause;
      const code = cause.isForeign ? 'decode/unsupported' : cause.isCut ? 'decode/truncated' : 'decode/corrupt';
      throw damaged(where, 'a lossless WebP image', cause.message, code, cause);
    }
  }
}
