import { constants } from './generated/shaders.js';
import type { GaussianBlock } from './gaussian-scene.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GEOMETRY_WORDS } from './pack/words.js';

/** Maximum number of 256-splat runs to read. */
const MAX_RUNS = 256;
const { CULL_GROUP } = constants;
const RUN_BYTES = 4 * GEOMETRY_WORDS * CULL_GROUP;

/** Centers and opacities of splats. */
export interface Samples {
  readonly count: number;
  /** [N, 3] positions relative to the origin of the scene */
  readonly positions: Float32Array;
  /** [N] opacities, above 0 and at most 1 */
  readonly opacities: Float32Array;
  /** Number of sampled rows with unusable values, which the packing shader replaced by zeros. */
  readonly unusable: number;
}

/** Reads evenly spaced runs of 256 splats over the blocks back from the GPU. Splats of opacity 0 are skipped. */
export async function readSamples(device: GPUDevice, pages: readonly GaussianBlock[]): Promise<Samples> {
  const runs = pages.flatMap(({ geometry, count }) =>
    Array.from({ length: Math.ceil(count / CULL_GROUP) }, (_, run) => ({
      geometry,
      offset: run * RUN_BYTES,
      size: 4 * GEOMETRY_WORDS * Math.min(CULL_GROUP, count - run * CULL_GROUP),
    })),
  );
  const step = Math.max(1, Math.ceil(runs.length / MAX_RUNS));
  const sample = runs.filter((_, i) => i % step === 0);
  const staging = device.createBuffer({
    label: 'gs.places',
    size: Math.max(
      4,
      sample.reduce((sum, { size }) => sum + size, 0),
    ),
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  try {
    const encoder = device.createCommandEncoder({ label: 'gs.places' });
    let at = 0;
    for (const { geometry, offset, size } of sample) {
      encoder.copyBufferToBuffer(geometry, offset, staging, at, size);
      at += size;
    }
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    return visibleSamples(new Uint32Array(staging.getMappedRange()));
  } finally {
    staging.destroy();
  }
}

function visibleSamples(words: Uint32Array): Samples {
  const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
  const [positions, opacities] = [[] as number[], [] as number[]];
  let unusable = 0;
  for (let at = 0; at + GEOMETRY_WORDS <= words.length; at += GEOMETRY_WORDS) {
    const opacity = opacityOf(words, at);
    if (words.subarray(at, at + GEOMETRY_WORDS).every((word) => word === 0)) unusable++;
    if (!(opacity > 0)) continue;
    positions.push(floats[at], floats[at + 1], floats[at + 2]);
    opacities.push(opacity);
  }
  return {
    count: opacities.length,
    positions: Float32Array.from(positions),
    opacities: Float32Array.from(opacities),
    unusable,
  };
}

const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);

/** Returns the opacity of a splat. Same decoding as `unpack_gaussian` of shaders/shared/packed_gaussian.wgsl. */
function opacityOf(words: Uint32Array, at: number): number {
  bits[0] = (words[at + 5] << 24) | ((words[at + 6] & 0x3ff) << 14) | ((words[at + 7] & 0x3ff) << 4);
  return float[0];
}
