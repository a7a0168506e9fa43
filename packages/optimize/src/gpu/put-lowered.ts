import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { BUFFER_USAGE, GpuMemory, rareKernelOf, submitPass, uniformWith } from '@gaussian-splat/renderer/stages';
import { readBackWith, type ReadPart } from '@gaussian-splat/renderer/tools';
import { optimizeTake, SCORE_GROUP } from '../generated/shaders.js';
import { partsOf, poolFor, type TaskPool } from '../parts/task-pool.js';
import type { ReducedCloud } from '../reduce.js';
import { layouts } from './layouts.js';
import type { ScenePart, SceneParts } from './scene-parts.js';

/** Splats of a part that keep the same degree, which is below the degree of the scene. */
interface LoweredSplats {
  readonly part: ScenePart;
  readonly degree: ShDegree;
  /** Indices of these splats in the reduced cloud. */
  readonly places: Uint32Array;
}

/**
 * Writes the coefficients of the splats that keep a lower degree to a reduced cloud. Only these are read back from the
 * GPU.
 * @param kept [N] index in the scene of each splat of the reduced cloud.
 */
export async function putLowered(
  device: GPUDevice,
  { gaussians: { shDegree }, parts }: SceneParts,
  { cloud, degrees }: ReducedCloud,
  kept: Uint32Array,
  pool: TaskPool,
): Promise<void> {
  const workers = poolFor(pool, cloud.count, [cloud.sh]);
  const lists = parts.flatMap((part) => loweredSplatsOf(part, shDegree, kept, degrees));
  const memory = new GpuMemory(device);
  try {
    const taken = lists.map((list) => take(device, memory, shDegree, list, kept));
    const rows = await readBackWith(device, taken, (mapped) => numbersIn(mapped, workers));
    const length = 3 * shCoefficientCount(cloud.shDegree);
    const inputs = lists.flatMap(({ degree, places }, k) => {
      const width = 3 * shCoefficientCount(degree);
      return partsOf(places.length, workers).map(({ first, end }) => ({
        ...{ width, length, to: cloud.sh, places: places.slice(first, end) },
        rows: rows[k].subarray(width * first, width * end),
      }));
    });
    await workers.run('putRows', inputs);
  } finally {
    memory.destroy();
  }
}

/** Returns the splats of a part that keep a lower degree, grouped by their degree. */
function loweredSplatsOf(part: ScenePart, shDegree: ShDegree, kept: Uint32Array, degrees: Uint8Array): LoweredSplats[] {
  const end = part.first + part.page.count;
  const places = Array.from({ length: shDegree }, () => new Uint32Array(kept.length));
  const counts = new Uint32Array(shDegree);
  for (let k = 0; k < kept.length; k++) {
    const degree = degrees[k];
    if (degree < shDegree && kept[k] >= part.first && kept[k] < end) places[degree][counts[degree]++] = k;
  }
  return places
    .map((own, degree) => ({ part, degree: degree as ShDegree, places: own.subarray(0, counts[degree]) }))
    .filter((list) => list.places.length > 0);
}

/** Copies the coefficients of some splats to a contiguous buffer on the GPU. */
function take(
  device: GPUDevice,
  memory: GpuMemory,
  sh_degree: ShDegree,
  { part, degree, places }: LoweredSplats,
  kept: Uint32Array,
): ReadPart {
  const { storage, copySource } = BUFFER_USAGE;
  const splats = places.map((k) => kept[k] - part.first);
  const width = 3 * shCoefficientCount(degree);
  const count = width * splats.length;
  const taken = memory.buffer('gs.optimize.taken', 4 * count, storage | copySource);
  const kernel = rareKernelOf(device, optimizeTake);
  const bindings = kernel.bind({
    take: uniformWith(memory, 'gs.optimize.take', layouts.Take, { count, width, sh_degree, degree }),
    splats: memory.buffer('gs.optimize.splats', splats.byteLength, storage, splats),
    ...{ lowered: part.lowered, taken },
  });
  submitPass(device, 'gs.optimize.take', (pass) => kernel.dispatch(pass, bindings, Math.ceil(count / SCORE_GROUP)));
  return { buffer: taken, byteLength: 4 * count };
}

/** Copies float32 numbers to memory of the pool. */
function numbersIn(bytes: ArrayBuffer, pool: TaskPool): Float32Array {
  const numbers = new Float32Array(pool.allocate(bytes.byteLength));
  numbers.set(new Float32Array(bytes));
  return numbers;
}
