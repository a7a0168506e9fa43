import type { LoadBudget } from '../budget.js';
import { viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import type { ImageFile } from './images.js';
import { WasmDecoder } from './wasm-decoder.js';

/** Output format of the transcoder, `cTFRGBA32`: four bytes for each pixel. */
const RGBA32 = 13;

/** Offsets in a file: the supercompression scheme, and the inflated size of the largest level in its index. */
const [SCHEME, INFLATED] = [44, 96];
const ZSTANDARD = 2;

/** Returns the bytes that Zstandard inflates for the largest level of an image; 0 for other images. */
function inflatedBytes(bytes: Uint8Array): number {
  const view = viewOf(bytes);
  return view.getUint32(SCHEME, true) === ZSTANDARD ? Number(view.getBigUint64(INFLATED, true)) : 0;
}

/** Decoder of KTX2 images by Basis Universal. */
export class Ktx2Decoder {
  readonly #budget: LoadBudget;
  readonly #decoder;

  /** @param budget Account that is charged for the memory of the transcoder, and for decoded images. */
  constructor(budget: LoadBudget) {
    this.#budget = budget;
    this.#decoder = new WasmDecoder('KTX2', budget, () => import('./basis-code.js'));
  }

  /**
   * Decodes the largest level of an image.
   * @param where Name of the image in error messages.
   * @returns [height, width, 4] bytes: red, green, blue and alpha, in the row order of the file.
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
        this.#budget.take(4 * width * height + inflatedBytes(bytes), where);
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
