import { GaussianSplatError } from '@gaussian-splat/core';
import type { GaussianScene } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { readBackWith } from '../gpu/read-back.js';
import { type PackedGaussians } from './pack.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from './words.js';

const { CULL_GROUP } = constants;

const notWhole = (): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'readPacked',
    expected: 'a scene that is on the GPU as a whole',
    found: 'a streamed one, of which pages come and go',
    remedy: 'read the file that it was made from',
  });

/**
 * Reads a packed scene back from the GPU, for tools that derive another scene from it. Scenes of generators cannot be
 * read. Rejects if the device is lost meanwhile, and with GaussianSplatError `argument/value` for a streamed scene.
 * @param check Called before each buffer is read, because the call takes several tasks. It must throw if the buffers
 * were freed meanwhile.
 */
export async function readPacked(
  device: GPUDevice,
  scene: GaussianScene,
  check: () => void = () => undefined,
): Promise<PackedGaussians> {
  const { shDegree, shPrecision, antialiased, filterVariance, origin, blocks, pageRequests } = scene;
  if (pageRequests) throw notWhole();
  const stride = shWords(shDegree, shPrecision);
  const read = (name: 'geometry' | 'sh' | 'chunks', words: (count: number) => number): Promise<Uint32Array> =>
    readPages(
      device,
      blocks.map((page) => ({ buffer: page[name], words: words(page.count) })),
      check,
    );
  const geometry = await read('geometry', (count) => GEOMETRY_WORDS * count);
  const sh = await read('sh', (count) => stride * count);
  const chunks = await read('chunks', (count) => CHUNK_NUMBERS * Math.ceil(count / CULL_GROUP));
  const count = geometry.length / GEOMETRY_WORDS;
  const droppedCount = (scene as { droppedCount?: number }).droppedCount ?? 0;
  return {
    ...{ count, shDegree, shPrecision, antialiased, filterVariance, origin, droppedCount, geometry, sh },
    chunks: new Float32Array(chunks.buffer),
  };
}

async function readPages(
  device: GPUDevice,
  parts: readonly { readonly buffer: GPUBuffer; readonly words: number }[],
  check: () => void,
): Promise<Uint32Array> {
  const all = new Uint32Array(parts.reduce((sum, { words }) => sum + words, 0));
  let at = 0;
  for (const { buffer, words } of parts) {
    if (words === 0) continue;
    check();
    await readBackWith(device, [{ buffer, byteLength: 4 * words }], (mapped) => all.set(new Uint32Array(mapped), at));
    at += words;
  }
  return all;
}
