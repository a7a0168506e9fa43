/** Decompression of buffer views that meshoptimizer has compressed. This module is loaded for files that have some. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import type { Json } from './container.js';
import type { GltfDocument } from './document.js';
import { MeshoptDecoder } from './meshopt-code.js';
import { meshoptParameters } from './meshopt-view.js';

/**
 * Returns the decompressed bytes of a buffer view.
 * @param packed Properties of its compression.
 * @param path Path of the view in the JSON.
 * @throws GaussianSplatError `decode/header`, `decode/corrupt`, `out-of-memory/budget`; `decode/unsupported` if the page
 * forbids WebAssembly
 */
export async function unpackView(document: GltfDocument, packed: Json, path: string): Promise<Uint8Array> {
  const { count, stride, mode, filter } = meshoptParameters(document, packed, path);
  const where = `${document.name}, ${path}`;
  const source = await document.readRange(packed, path);
  await (MeshoptDecoder.ready ?? Promise.reject(new Error('no WebAssembly'))).catch((cause: unknown) => {
    throw new GaussianSplatError('decode/unsupported', {
      where,
      expected: 'permission to run WebAssembly, which decodes meshopt',
      found: (cause as Error).message,
      remedy: `allow 'wasm-unsafe-eval' in script-src of the page's Content-Security-Policy, or write the file without meshopt`,
      cause,
    });
  });
  // The decoder copies the source and the result to its own memory.
  document.take(2 * (count * stride + source.length));
  const bytes = new Uint8Array(count * stride);
  try {
    MeshoptDecoder.decodeGltfBuffer(bytes, count, stride, source, mode, filter);
  } catch (cause) {
    const expected = `${grouped(count)} elements of ${stride} bytes, compressed by meshoptimizer`;
    throw damaged(where, expected, (cause as Error).message, 'decode/corrupt', cause);
  }
  return bytes;
}
