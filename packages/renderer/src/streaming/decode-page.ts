import { GaussianSplatError } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { halfBits } from '../pack/half.js';
import { BAND_SIZES, FIRST_CODE_BYTE, SCALE_BYTES } from '../pack/sh.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from '../levels/chunk-detail.js';
import { pageLayout, SLOT_CHUNKS } from './manifest.js';
import {
  CHROMA_CODES,
  CHUNK_FLOATS,
  CLASS_STEP,
  DIFFERENCES,
  FILE_FLOATS,
  compactBits,
  headBytes,
  maxBytes,
  MIDDLE,
  PLANES,
  planesOf,
  SIZE_CODES,
  type CodedFile,
} from './page-coding.js';
import { putRow, QUANTIZED_CHUNK_WORDS, ROW_CODES } from './quantized-geometry.js';
import { CHUNK_NUMBERS, shWords } from '../pack/words.js';

const { CULL_GROUP, NO_CHILDREN, QUANTIZED_HEAD_ROWS, QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO } = constants;
const HALF_CODE = 2 ** 24;
const ALL_CODES = 2 ** 48;

/**
 * Decodes a coded page file. Resolves to the words that the GPU reads, in the layout of docs/lod-format.md.
 * @param where Name of the file, for error messages.
 * @throws GaussianSplatError `decode/corrupt` or `decode/truncated` for malformed bytes.
 */
export async function decodePage(where: string, bytes: Uint8Array<ArrayBuffer>, file: CodedFile): Promise<ArrayBuffer> {
  const inflated = await inflate(where, bytes, maxBytes(file));
  return new PageDecoder(where, inflated, file).decode();
}

/** Inflates raw deflate data. Throws if the result exceeds `max` bytes, regardless of the size that a file declares. */
async function inflate(where: string, bytes: Uint8Array<ArrayBuffer>, max: number): Promise<Uint8Array> {
  const whole = new Uint8Array(max);
  let length = 0;
  const reader = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate-raw')).getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return whole.subarray(0, length);
      if (length + value.length > max) throw corrupt(where, `at most ${max} bytes, decompressed`, 'more');
      whole.set(value, length);
      length += value.length;
    }
  } catch (error) {
    await reader.cancel().catch(() => undefined);
    if (error instanceof GaussianSplatError) throw error;
    throw corrupt(where, 'bytes that deflate made', (error as Error).message, error);
  }
}

function corrupt(where: string, expected: string, found: string, cause?: unknown): GaussianSplatError {
  return new GaussianSplatError('decode/corrupt', {
    ...{ where, expected, found, cause },
    remedy: 'write the folder again with gaussian-splat detail, and upload all files of it',
  });
}

class PageDecoder {
  readonly #file: CodedFile;
  readonly #bytes: Uint8Array;
  readonly #counts: Uint8Array;
  readonly #splats: number;
  /** Number of splats with a class above 0: only they have harmonics. */
  #classed = 0;
  readonly #floats: Float32Array;

  constructor(where: string, bytes: Uint8Array, file: CodedFile) {
    this.#file = file;
    const { chunks, shDegree } = file;
    this.#bytes = bytes;
    this.#counts = bytes.subarray(0, chunks);
    this.#splats = this.#counts.reduce((sum, count) => sum + count + 1, 0);
    const plain = Math.min(planesOf(shDegree), PLANES.harmonics);
    const rest = planesOf(shDegree) - plain;
    if (rest > 0 && bytes.length >= headBytes(file) + this.#splats * plain) {
      this.#undoDifferences(PLANES.class, PLANES.harmonics);
      this.#classed = this.#plane(PLANES.class).reduce((sum, one) => sum + (one > 0 ? 1 : 0), 0);
    }
    const length = headBytes(file) + this.#splats * plain + this.#classed * rest;
    if (bytes.length !== length) {
      throw new GaussianSplatError('decode/truncated', {
        where,
        expected: `${length} bytes, decompressed`,
        found: `${bytes.length} bytes`,
        remedy: 'upload the folder again, all files of it from one run of gaussian-splat detail',
      });
    }
    this.#floats = this.#readFloats(chunks, CHUNK_FLOATS * chunks + FILE_FLOATS);
    this.#undoDifferences(0, Math.min(PLANES.class, planesOf(shDegree)));
    this.#undoDifferences(PLANES.harmonics, planesOf(shDegree));
  }

  /** Reads `count` float32 from byte `at` on. Their bytes are stored plane by plane. */
  #readFloats(at: number, count: number): Float32Array {
    const words = new Uint32Array(count);
    for (let k = 0; k < count; k++) {
      for (let byte = 0; byte < 4; byte++) words[k] |= this.#bytes[at + byte * count + k] << (8 * byte);
    }
    return new Float32Array(words.buffer);
  }

  #undoDifferences(from: number, end: number): void {
    const modes = headBytes(this.#file) - planesOf(this.#file.shDegree);
    for (let k = from; k < end; k++) {
      if (this.#bytes[modes + k] !== DIFFERENCES) continue;
      const plane = this.#plane(k);
      for (let i = 1; i < plane.length; i++) plane[i] += plane[i - 1];
    }
  }

  #plane(k: number): Uint8Array {
    const behind = Math.max(0, k - PLANES.harmonics);
    const at = headBytes(this.#file) + this.#splats * (k - behind) + this.#classed * behind;
    return this.#bytes.subarray(at, at + (k < PLANES.harmonics ? this.#splats : this.#classed));
  }

  decode(): ArrayBuffer {
    const { chunks, shDegree } = this.#file;
    const layout = pageLayout({ shDegree, shPrecision: 'int8', geometry: 'quantized' }, chunks);
    const words = new Uint32Array(layout.total);
    const floats = new Float32Array(words.buffer);
    const geometryAt = layout.chunks + layout.details;
    const bounds = floats.subarray(0, layout.chunks);
    this.#putDetails(words.subarray(layout.chunks, geometryAt));
    this.#putGeometry(words.subarray(geometryAt, geometryAt + layout.geometry), bounds);
    this.#putHarmonics(words.subarray(geometryAt + layout.geometry));
    return words.buffer;
  }

  /** Returns number `field` of a chunk, 0 to `CHUNK_FLOATS` - 1. */
  #of(chunk: number, field: number): number {
    return this.#floats[CHUNK_FLOATS * chunk + field];
  }

  #putDetails(rows: Uint32Array): void {
    const { chunks, upper } = this.#file;
    const floats = new Float32Array(rows.buffer, rows.byteOffset, rows.length);
    const above = this.#floats.subarray(CHUNK_FLOATS * chunks);
    for (let c = 0; c < chunks; c++) {
      const at = DETAIL_NUMBERS * c;
      const own = this.#floats.subarray(CHUNK_FLOATS * c + 5, CHUNK_FLOATS * (c + 1));
      const up = CHUNK_FLOATS * Math.floor((c - upper) / SLOT_CHUNKS) + 5;
      const parent = c < upper ? above : this.#floats.subarray(up, up + 5);
      floats.set(own.subarray(0, 4), at + DETAIL_PLACES.sphere);
      floats.set(parent.subarray(0, 4), at + DETAIL_PLACES.parentSphere);
      floats[at + DETAIL_PLACES.error] = own[4];
      floats[at + DETAIL_PLACES.fullError] = own[4];
      floats[at + DETAIL_PLACES.parentError] = parent[4];
      rows[at + DETAIL_PLACES.children] = NO_CHILDREN;
    }
  }

  /** Writes the geometry of all chunks, and the boxes of their splat centers to `bounds`. */
  #putGeometry(words: Uint32Array, bounds: Float32Array): void {
    const { chunks, coding } = this.#file;
    const heads = new Float32Array(words.buffer, words.byteOffset, words.length);
    const place = [0, 1, 2, 3, 4, 5].map((k) => this.#plane(PLANES.place + k));
    const [sx, sy, sz] = [0, 1, 2].map((k) => this.#plane(PLANES.size + k));
    const [t, u, v] = [0, 1, 2].map((k) => this.#plane(PLANES.direction + k));
    const opacities = this.#plane(PLANES.opacity);
    const last = coding.directions - 1;
    const onLine = Int32Array.from({ length: 256 }, (_, k) => Math.round((2 * QUANTIZED_T_ZERO * k) / last));
    const inSquare = Int32Array.from({ length: 256 }, (_, k) => Math.round((2 * QUANTIZED_UV_ZERO * k) / last));
    const codes = new Int32Array(ROW_CODES);
    const max = new Int32Array(3);
    for (let c = 0, i = 0; c < chunks; c++) {
      const at = QUANTIZED_CHUNK_WORDS * c;
      for (let axis = 0; axis < 3; axis++) {
        heads[at + axis] = this.#of(c, axis);
        heads[at + 4 + axis] = this.#of(c, 3);
      }
      heads[at + 3] = this.#floats[CHUNK_FLOATS * chunks + 5];
      heads[at + 7] = coding.size / SIZE_CODES;
      max.fill(0);
      let code = 0;
      let row = at + 4 * QUANTIZED_HEAD_ROWS;
      for (const end = i + this.#counts[c] + 1; i < end; i++, row += 4) {
        const low = place[0][i] | (place[1][i] << 8) | (place[2][i] << 16);
        const high = place[3][i] | (place[4][i] << 8) | (place[5][i] << 16);
        code = (code + HALF_CODE * high + low) % ALL_CODES;
        const [fine, coarse] = [code % HALF_CODE, Math.floor(code / HALF_CODE)];
        for (let axis = 0; axis < 3; axis++) {
          codes[axis] = compactBits(fine << axis) | (compactBits(coarse << axis) << 8);
          if (codes[axis] > max[axis]) max[axis] = codes[axis];
        }
        codes[3] = SIZE_CODES * sx[i];
        codes[4] = SIZE_CODES * sy[i];
        codes[5] = SIZE_CODES * sz[i];
        codes[6] = Math.min(onLine[t[i]], 4095);
        codes[7] = Math.min(inSquare[u[i]], 8191);
        codes[8] = Math.min(inSquare[v[i]], 8191);
        codes[9] = Math.min(coding.opacity * opacities[i], 4095);
        putRow(words, row, codes);
      }
      const box = CHUNK_NUMBERS * c;
      for (let axis = 0; axis < 3; axis++) {
        bounds[box + axis] = heads[at + axis];
        bounds[box + 4 + axis] = heads[at + axis] + heads[at + 4 + axis] * max[axis];
      }
      bounds[box + 3] = this.#of(c, 4);
    }
  }

  /** Writes the harmonics of all splats in the layout `int8` of packSh in pack/sh.ts. */
  #putHarmonics(words: Uint32Array): void {
    const { chunks, shDegree, coding } = this.#file;
    const bytes = new Uint8Array(words.buffer, words.byteOffset, 4 * words.length);
    const halves = new Uint16Array(words.buffer, words.byteOffset, 2 * words.length);
    const stride = 4 * shWords(shDegree, 'int8');
    const wide = (k: number): Int16Array => {
      const [low, high] = [this.#plane(PLANES.color + 2 * k), this.#plane(PLANES.color + 2 * k + 1)];
      return Int16Array.from(low, (byte, i) => (byte | (high[i] << 8)) - MIDDLE);
    };
    const [luma, orange, green] = [wide(0), wide(1), wide(2)];
    const classes = shDegree > 0 ? this.#plane(PLANES.class) : undefined;
    const signed = Array.from({ length: Math.max(0, planesOf(shDegree) - PLANES.harmonics) }, (_, k) => {
      const plane = this.#plane(PLANES.harmonics + k);
      return new Int8Array(plane.buffer, plane.byteOffset, plane.length);
    });
    const count = signed.length / 3;
    const places = harmonicPlaces(shDegree, stride);
    for (let c = 0, i = 0, j = 0; c < chunks; c++) {
      let at = stride * CULL_GROUP * c;
      for (const end = i + this.#counts[c] + 1; i < end; i++, at += stride) {
        const [o, g] = [coding.chroma * orange[i], coding.chroma * green[i]];
        const rest = coding.color * luma[i] - g / 2;
        halves[at / 2] = halfBits(rest + o / 2);
        halves[at / 2 + 1] = halfBits(rest + g);
        halves[at / 2 + 2] = halfBits(rest - o / 2);
        const own = classes?.[i] ?? 0;
        if (own === 0) continue;
        // Splats of class 0 keep a scale of 0, which makes all their coefficients zero.
        const scale = Math.min(255, coding.scale + CLASS_STEP * (own - 1));
        for (let band = 0; band < shDegree; band++) bytes[at + SCALE_BYTES[band]] = scale;
        for (let k = 0; k < count; k++) {
          const fromRed = CHROMA_CODES * signed[count + k][j];
          const fromGreen = CHROMA_CODES * signed[2 * count + k][j];
          const middle = signed[k][j] - fromGreen / 2;
          bytes[at + places[3 * k]] = limited(middle + fromRed / 2);
          bytes[at + places[3 * k + 1]] = limited(middle + fromGreen);
          bytes[at + places[3 * k + 2]] = limited(middle - fromRed / 2);
        }
        j++;
      }
    }
  }
}

const limited = (code: number): number => Math.min(127, Math.max(-127, code));

/** Returns the byte offsets of the coefficients above the constant one, relative to the beginning of a splat. */
function harmonicPlaces(degree: number, stride: number): readonly number[] {
  const all = BAND_SIZES.slice(0, degree).reduce((sum, size) => sum + 3 * size, 0);
  const places = Array.from({ length: all }, (_, k) => FIRST_CODE_BYTE + k);
  // Degree 1 has nine codes but eight places after the scales; the ninth takes the place of an unused scale: see
  // packSh.
  return places.map((place) => (place < stride ? place : SCALE_BYTES[1]));
}
