import { GaussianSplatError } from '@gaussian-splat/core';
import type { LoadedMesh } from '../../loading/open-mesh-file.js';
import { loadMeshoptDecoder } from './three.js';

/**
 * Returns all buffer views of a file, decoding those that meshoptimizer has compressed.
 * @throws GaussianSplatError `decode/corrupt`, or `decode/unsupported` if the page forbids WebAssembly
 */
export async function unpackedViews(
  views: LoadedMesh['views'],
  where: string,
): Promise<readonly (ArrayBuffer | undefined)[]> {
  if (!views.some((view) => view && 'source' in view))
    return views.map((view) => (view && !('source' in view) ? view.buffer : undefined));
  const decoder = await loadMeshoptDecoder();
  await (decoder.ready ?? Promise.reject(new Error('no WebAssembly'))).catch((cause: unknown) => {
    throw new GaussianSplatError('decode/unsupported', {
      where,
      expected: 'permission to run WebAssembly, which decodes meshopt',
      found: (cause as Error).message,
      remedy: `allow 'wasm-unsafe-eval' in script-src of the page's Content-Security-Policy, or write the file without meshopt`,
      cause,
    });
  });
  return Promise.all(
    views.map(async (view, index) => {
      if (!view || !('source' in view)) return view?.buffer;
      const { source, count, stride, mode, filter } = view;
      try {
        return (await decoder.decodeGltfBufferAsync(count, stride, source, mode, filter)).buffer;
      } catch (cause) {
        throw new GaussianSplatError('decode/corrupt', {
          where: `${where}, bufferViews[${index}]`,
          expected: `${count} elements of ${stride} bytes, compressed by meshoptimizer`,
          found: (cause as Error).message,
          remedy: 'export the file again; it is damaged',
          cause,
        });
      }
    }),
  );
}
