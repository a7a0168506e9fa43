/** Lossless WebP by libwebp, in WebAssembly (@jsquash/webp). */
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import encode, { init } from '@jsquash/webp/encode.js';

const CODEC = 'codec/enc/webp_enc_simd.wasm';
let loading;

/** Node fetches no files, so the module is read here; every version of Node that we run in has SIMD. */
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
