import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import type { GaussianBlock } from '@gaussian-splat/renderer/tools';
import { BUFFER_USAGE, type GpuMemory, pageCapacity, withMemoryCheck } from '@gaussian-splat/renderer/stages';
import { CloudBuffers } from './cloud-buffers.js';
import { layouts } from './layouts.js';

const CHUNK = 256;
const FLOAT_BYTES = 4;

/** A block of the scene, and the buffers with results for its splats. */
export interface ScenePart {
  readonly page: GaussianBlock;
  /** Slot of the block's first splat, which is a multiple of 256. */
  readonly first: number;
  /** Number of splats rounded up to chunks of 256, which is the length of a row in the buffers below. */
  readonly row: number;
  /** `array<Score>`, an element for each splat. */
  readonly scores: GPUBuffer;
  /** `array<f32>` with a row for each view that is scored at once: the energy of each splat. */
  readonly energies: GPUBuffer;
  /** `array<f32>` with a row for each entry of the moments of color; see shaders/shared/moments.wgsl. */
  readonly moments: GPUBuffer;
  /** `array<f32>` with {@link loweredNumbers} numbers for each splat. */
  readonly lowered: GPUBuffer;
}

/**
 * Returns the offset of the coefficients of degree `lower` in the data of each splat. The data are an error for each lower
 * degree, and then the coefficients of each lower degree. For the degree of the scene, it is the length of the data. Same
 * as `lowered_numbers` of the shaders.
 */
export function loweredNumbers(degree: ShDegree, lower: number = degree): number {
  let numbers: number = degree;
  for (let k = 0; k < lower; k++) numbers += 3 * shCoefficientCount(k as ShDegree);
  return numbers;
}

/** Returns the number of entries in the lower triangle of a matrix of all basis functions; 0 for degree 0. */
function momentNumbers(degree: ShDegree): number {
  const size = shCoefficientCount(degree);
  return degree === 0 ? 0 : (size * (size + 1)) / 2;
}

/** A cloud on the GPU, in parts whose buffers do not exceed the maximum size of a binding. */
export class SceneParts {
  readonly gaussians: CloudBuffers;
  readonly parts: readonly ScenePart[];
  /** Number of splats of the scene, with each part rounded up to chunks of 256. */
  readonly slots: number;
  /** Number of views whose energies the buffers can contain. */
  readonly views: number;
  readonly #memory: GpuMemory;

  private constructor(memory: GpuMemory, gaussians: CloudBuffers, views: number) {
    this.#memory = memory;
    this.gaussians = gaussians;
    this.views = views;
    let first = 0;
    this.parts = gaussians.blocks.map((page) => {
      const part = partOf(memory, page, first, views, gaussians.shDegree);
      first += part.row;
      return part;
    });
    this.slots = first;
  }

  /**
   * Uploads a cloud, and allocates the buffers of results.
   * @param views Number of views that are scored at once.
   * @param maxSplats Maximum number of splats of a part. By default, only the limits of the device apply.
   * @throws GaussianSplatError `out-of-memory/*`
   */
  static async upload(
    device: GPUDevice,
    cloud: GaussianCloud,
    views: number,
    maxSplats = Infinity,
  ): Promise<SceneParts> {
    const largest = Math.max(
      layouts.Score.size,
      FLOAT_BYTES * Math.max(views, momentNumbers(cloud.shDegree), loweredNumbers(cloud.shDegree)),
    );
    const pageSplats = Math.min(maxSplats, pageCapacity(device, largest));
    const gaussians = await CloudBuffers.upload(device, cloud, pageSplats);
    try {
      const where = `scores of ${cloud.count} splats`;
      return await withMemoryCheck(device, where, (memory) => new SceneParts(memory, gaussians, views));
    } catch (error) {
      gaussians.destroy();
      throw error;
    }
  }

  destroy(): void {
    this.gaussians.destroy();
    this.#memory.destroy();
  }
}

function partOf(memory: GpuMemory, page: GaussianBlock, first: number, views: number, degree: ShDegree): ScenePart {
  const row = CHUNK * Math.ceil(page.count / CHUNK);
  const { storage, copySource, copyDestination } = BUFFER_USAGE;
  const buffer = (name: string, bytesOfSplat: number): GPUBuffer =>
    memory.buffer(`gs.optimize.${name}`, bytesOfSplat * row, storage | copySource | copyDestination);
  return {
    ...{ page, first, row },
    scores: buffer('scores', layouts.Score.size),
    energies: buffer('energies', FLOAT_BYTES * views),
    moments: buffer('moments', FLOAT_BYTES * momentNumbers(degree)),
    lowered: buffer('lowered', FLOAT_BYTES * loweredNumbers(degree)),
  };
}
