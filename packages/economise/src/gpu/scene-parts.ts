import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import type { GaussianPage } from '@gaussian-splat/renderer/tools';
import { BUFFER_USAGE, GpuMemory, pageCapacity, withMemoryCheck } from '@gaussian-splat/renderer/stages';
import { CloudBuffers } from './cloud-buffers.js';
import { layouts } from './layouts.js';

const CHUNK = 256;
const FLOAT_BYTES = 4;

/** A page of the scene, and what is known of its splats. */
export interface ScenePart {
  readonly page: GaussianPage;
  /** Number of its first splat among all, which is a multiple of 256. */
  readonly first: number;
  /** Splats in whole chunks: from one row of `energies` to the next. */
  readonly row: number;
  /** array<Score> */
  readonly scores: GPUBuffer;
  /** array<f32>: a row for each of the views at hand. */
  readonly energies: GPUBuffer;
  /** array<f32>: a row for each number of the moments of colour: see shaders/shared/moments.wgsl. */
  readonly moments: GPUBuffer;
  /** array<f32>: {@link loweredNumbers} for each splat. */
  readonly lowered: GPUBuffer;
}

/**
 * Numbers that come before the coefficients of a lower degree in what is found for each splat: an error for each lower degree, and the coefficients of degrees below that one.
 * With the scene's own degree: all of them. `lowered_numbers` of the shaders.
 */
export function loweredNumbers(degree: ShDegree, lower: number = degree): number {
  let numbers: number = degree;
  for (let k = 0; k < lower; k++) numbers += 3 * shCoefficientCount(k as ShDegree);
  return numbers;
}

/** Numbers of a triangle of basis functions against one another; none where there is no lower degree. */
function momentNumbers(degree: ShDegree): number {
  const size = shCoefficientCount(degree);
  return degree === 0 ? 0 : (size * (size + 1)) / 2;
}

/** A cloud on the GPU, in parts that a binding holds with all that is found out about them. */
export class SceneParts {
  readonly gaussians: CloudBuffers;
  readonly parts: readonly ScenePart[];
  /** Splats of the scene, of every part whole chunks. */
  readonly slots: number;
  /** Views that `energies` has room for. */
  readonly views: number;
  readonly #memory: GpuMemory;

  private constructor(memory: GpuMemory, gaussians: CloudBuffers, views: number) {
    this.#memory = memory;
    this.gaussians = gaussians;
    this.views = views;
    let first = 0;
    this.parts = gaussians.pages.map((page) => {
      const part = partOf(memory, page, first, views, gaussians.shDegree);
      first += part.row;
      return part;
    });
    this.slots = first;
  }

  /**
   * @param views how many the scene is scored in at once
   * @param mostSplats of a part; default what the device's limits allow
   * @throws GaussianSplatError `out-of-memory/*`
   */
  static async upload(
    device: GPUDevice,
    cloud: GaussianCloud,
    views: number,
    mostSplats = Infinity,
  ): Promise<SceneParts> {
    const largest = Math.max(
      layouts.Score.size,
      FLOAT_BYTES * Math.max(views, momentNumbers(cloud.shDegree), loweredNumbers(cloud.shDegree)),
    );
    const pageSplats = Math.min(mostSplats, pageCapacity(device, largest));
    const gaussians = await CloudBuffers.upload(device, cloud, pageSplats);
    const memory = new GpuMemory(device);
    try {
      const destroy = (): void => memory.destroy();
      const where = `scores of ${cloud.count} splats`;
      const { made } = await withMemoryCheck(device, where, () => ({
        made: new SceneParts(memory, gaussians, views),
        destroy,
      }));
      return made;
    } catch (error) {
      memory.destroy();
      gaussians.destroy();
      throw error;
    }
  }

  destroy(): void {
    this.gaussians.destroy();
    this.#memory.destroy();
  }
}

function partOf(memory: GpuMemory, page: GaussianPage, first: number, views: number, degree: ShDegree): ScenePart {
  const row = CHUNK * Math.ceil(page.count / CHUNK);
  const { storage, copySource, copyDestination } = BUFFER_USAGE;
  const buffer = (name: string, bytesOfSplat: number): GPUBuffer =>
    memory.buffer(`gs.economise.${name}`, bytesOfSplat * row, storage | copySource | copyDestination);
  return {
    ...{ page, first, row },
    scores: buffer('scores', layouts.Score.size),
    energies: buffer('energies', FLOAT_BYTES * views),
    moments: buffer('moments', FLOAT_BYTES * momentNumbers(degree)),
    lowered: buffer('lowered', FLOAT_BYTES * loweredNumbers(degree)),
  };
}
