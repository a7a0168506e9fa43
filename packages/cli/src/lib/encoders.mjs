/** Encoders that commands pass to @gaussian-splat/optimize: raw deflate, and lossless WebP. */
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join } from 'node:path';
import { constants, deflateRawSync } from 'node:zlib';
import encode, { init } from '@jsquash/webp/encode.js';

const STRATEGIES = [constants.Z_DEFAULT_STRATEGY, constants.Z_HUFFMAN_ONLY, constants.Z_FILTERED];

/** Compresses bytes to a section of a raw deflate stream. A sync flush ends it, so that sections can be concatenated. */
const deflatedBy = (bytes, options) => deflateRawSync(bytes, { ...options, finishFlush: constants.Z_SYNC_FLUSH });

/** Compresses bytes to a section of a raw deflate stream, with the strategy of the smallest result. */
export function deflate(bytes) {
  const pieces = STRATEGIES.map((strategy) => deflatedBy(bytes, { strategy, level: 9, memLevel: 9 }));
  return pieces.reduce((best, piece) => (piece.length < best.length ? piece : best));
}

/** Compresses bytes to a section of a raw deflate stream at the fastest level, for temporary files. */
export const deflateQuickly = (bytes) => deflatedBy(bytes, { level: 1 });

/** Path of libwebp's WebAssembly in its package. Every supported version of Node has SIMD. */
const CODEC = 'codec/enc/webp_enc_simd.wasm';
let loading;

/** Compiles libwebp. The module is read from its file, because `fetch` of Node does not read files. */
function load() {
  const folder = dirname(createRequire(import.meta.url).resolve('@jsquash/webp/encode.js'));
  return init(new WebAssembly.Module(readFileSync(join(folder, CODEC))));
}

/** Encodes lossless WebP, as `EncodeWebp` of @gaussian-splat/optimize specifies. */
export async function encodeWebp(data, width, height, effort) {
  await (loading ??= load());
  const options = { lossless: 1, exact: 1, quality: 100 * effort, method: Math.round(6 * effort) };
  return new Uint8Array(await encode({ data, width, height }, options));
}
