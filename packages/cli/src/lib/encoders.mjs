/** Encoders that commands pass to the packages: raw deflate, and lossless WebP. */
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { constants, deflateRawSync } from 'node:zlib';
import encode, { init } from '@jsquash/webp/encode.js';

const STRATEGIES = [constants.Z_DEFAULT_STRATEGY, constants.Z_HUFFMAN_ONLY, constants.Z_FILTERED];

/** A section of a raw deflate stream: it ends with a sync flush, so that others can be appended. */
const deflatedBy = (bytes, options) => deflateRawSync(bytes, { ...options, finishFlush: constants.Z_SYNC_FLUSH });

/** Such a section, with the strategy that makes it smallest. */
export function deflate(bytes) {
  const pieces = STRATEGIES.map((strategy) => deflatedBy(bytes, { strategy, level: 9, memLevel: 9 }));
  return pieces.reduce((best, piece) => (piece.length < best.length ? piece : best));
}

/** Fast variant for temporary data. */
export const deflateQuickly = (bytes) => deflatedBy(bytes, { level: 1 });

/** Lossless WebP by libwebp, in WebAssembly. */
const CODEC = 'codec/enc/webp_enc_simd.wasm';
let loading;

/** Node's fetch does not read files, so the module is read here; every supported version of Node has SIMD. */
function load() {
  const folder = new URL('.', `file://${createRequire(import.meta.url).resolve('@jsquash/webp/encode.js')}`);
  return init(new WebAssembly.Module(readFileSync(new URL(CODEC, folder))));
}

/** See `EncodeWebp` of @gaussian-splat/economise. */
export async function encodeWebp(data, width, height, effort) {
  await (loading ??= load());
  const options = { lossless: 1, exact: 1, quality: 100 * effort, method: Math.round(6 * effort) };
  return new Uint8Array(await encode({ data, width, height }, options));
}
