import type { LoadBudget } from '../budget.js';
import { damaged } from '../faults.js';
import type { ImageFile } from './images.js';
import { WasmDecoder } from './wasm-decoder.js';

/** `cTFRGBA32` of the transcoder: four bytes a pixel. */
const RGBA32 = 13;

/** Decodes KTX2 images with Basis Universal. */
export class Ktx2Decoder {
  readonly #budget: LoadBudget;
  readonly #decoder;

  /** @param budget Memory of the transcoder is charged to it; images are charged when their headers are read. */
  constructor(budget: LoadBudget) {
    this.#budget = budget;
    this.#decoder = new WasmDecoder('KTX2', budget, () => import('./basis-code.js'));
  }

  /**
   * Decodes the largest level of an image.
   * @param where Name of the image in error messages.
   * @returns [height, width, 4] bytes: red, green, blue and alpha, as stored, the first row first.
   * @throws GaussianSplatError `decode/corrupt`, `decode/unsupported`, `out-of-memory/budget`
   */
  decode({ bytes, width, height }: ImageFile, where: string): Promise<Uint8ClampedArray<ArrayBuffer>> {
    return this.#decoder.run(where, (basis) => {
      basis.initializeBasis();
      const file = new basis.KTX2File(bytes);
      try {
        if (!file.isValid() || file.getWidth() !== width || file.getHeight() !== height || !file.startTranscoding())
          throw damaged(where, `an image of Basis Universal, ${width} x ${height} pixels`, 'other data');
        if (file.isHDR()) throw damaged(where, 'an image of 8 bits a channel', 'HDR', 'decode/unsupported');
        this.#budget.take(4 * width * height, where);
        const pixels = new Uint8Array(4 * width * height);
        if (!file.transcodeImage(pixels, 0, 0, 0, RGBA32, 0, -1, -1))
          throw damaged(where, 'an image that can be decoded', 'damaged data');
        return new Uint8ClampedArray(pixels.buffer);
      } finally {
        file.close();
        file.delete();
      }
    });
  }
}
