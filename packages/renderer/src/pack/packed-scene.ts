import { GaussianSplatError } from '@gaussian-splat/core';
import type { GaussianScene } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import { CHUNK_NUMBERS } from './chunks.js';
import { GEOMETRY_WORDS, type PackedGaussians } from './pack.js';
import { shWords } from './sh.js';

const { CULL_GROUP } = constants;
/** Place of the reach in a chunk: see `boundChunks`. */
const REACH = 3;

const notWhole = (): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'readPacked',
    expected: 'a scene that is on the GPU as a whole',
    found: 'a streamed one, of which pages come and go',
    remedy: 'read the file that it was made of',
  });

/**
 * Reads a scene back from the GPU as it was packed: for tools that make another one of it. Scenes that generators write cannot be read.
 * Rejects if the device is lost meanwhile, and with GaussianSplatError `argument/value` for a scene that is streamed.
 * @param check called before each of its buffers is read, which takes turns of the page: throws if they have been freed meanwhile
 */
export async function readPacked(
  device: GPUDevice,
  scene: GaussianScene,
  check: () => void = () => undefined,
): Promise<PackedGaussians> {
  const { shDegree, shPrecision, antialiased, filterVariance, origin, pages, wishes } = scene;
  if (wishes) throw notWhole();
  const stride = shWords(shDegree, shPrecision);
  const read = (name: 'geometry' | 'sh' | 'chunks', words: (count: number) => number): Promise<Uint32Array> =>
    readPages(
      device,
      pages.map((page) => ({ buffer: page[name], words: words(page.count) })),
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
    const usage = BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination;
    const staging = device.createBuffer({ label: 'gs.packed.read', size: 4 * words, usage });
    const encoder = device.createCommandEncoder({ label: 'gs.packed.read' });
    encoder.copyBufferToBuffer(buffer, 0, staging, 0, 4 * words);
    device.queue.submit([encoder.finish()]);
    try {
      await staging.mapAsync(0x1);
      all.set(new Uint32Array(staging.getMappedRange()), at);
    } finally {
      staging.destroy();
    }
    at += words;
  }
  return all;
}

/**
 * Some splats of a packed scene, in their order.
 * @param slots numbers of the splats that stay, ascending
 * @param pause called now and then: what it waits for is the page's turn
 */
export async function selectPacked(
  packed: PackedGaussians,
  slots: Uint32Array,
  pause: () => Promise<void> = () => Promise.resolve(),
): Promise<PackedGaussians> {
  const stride = shWords(packed.shDegree, packed.shPrecision);
  const geometry = new Uint32Array(GEOMETRY_WORDS * slots.length);
  const sh = new Uint32Array(stride * slots.length);
  const chunks = new Float32Array(CHUNK_NUMBERS * Math.ceil(slots.length / CULL_GROUP));
  const positions = new Float32Array(geometry.buffer);
  for (let first = 0; first < slots.length; first += CULL_GROUP) {
    const part = slots.subarray(first, first + CULL_GROUP);
    part.forEach((slot, i) => {
      copyWords(packed.geometry, GEOMETRY_WORDS * slot, geometry, GEOMETRY_WORDS * (first + i), GEOMETRY_WORDS);
      copyWords(packed.sh, stride * slot, sh, stride * (first + i), stride);
    });
    chunks.set(boundsOf(packed, part, positions, first), (CHUNK_NUMBERS * first) / CULL_GROUP);
    if ((first / CULL_GROUP) % CHUNKS_AT_ONCE === CHUNKS_AT_ONCE - 1) await pause();
  }
  return { ...packed, count: slots.length, geometry, sh, chunks };
}

/** Chunks between two pauses: a millisecond or so. */
const CHUNKS_AT_ONCE = 32;

function copyWords(from: Uint32Array, start: number, to: Uint32Array, at: number, count: number): void {
  for (let k = 0; k < count; k++) to[at + k] = from[start + k];
}

/** A chunk: the box of its centres, and a reach that is none too small: the largest of the chunks that the splats come from. */
function boundsOf(
  { chunks }: PackedGaussians,
  slots: Uint32Array,
  positions: Float32Array,
  first: number,
): readonly number[] {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  let reach = 0;
  slots.forEach((slot, i) => {
    for (let axis = 0; axis < 3; axis++) {
      const x = positions[GEOMETRY_WORDS * (first + i) + axis];
      low[axis] = Math.min(low[axis], x);
      high[axis] = Math.max(high[axis], x);
    }
    reach = Math.max(reach, chunks[CHUNK_NUMBERS * Math.floor(slot / CULL_GROUP) + REACH]);
  });
  return [...low, reach, ...high, 0];
}
