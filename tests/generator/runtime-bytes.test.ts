import assert from 'node:assert/strict';
import { statSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { WASM_BYTES } from '../../packages/generator/src/runtime/runtime-progress.js';

test('progress knows the length of the runtime that is installed', () => {
  const folder = fileURLToPath(new URL('../../node_modules/onnxruntime-web/dist/', import.meta.url));
  for (const [build, bytes] of Object.entries(WASM_BYTES)) {
    assert.equal(statSync(`${folder}ort-wasm-simd-threaded.${build}.wasm`).size, bytes, build);
  }
});
