import { GaussianBuffers, type UploadOptions } from '../gaussian-buffers.js';
import type { GaussianBlock, GaussianScene } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import { type GpuMemory, withMemoryCheck } from '../gpu/memory.js';
import { SceneBuffers } from '../scene-buffers.js';
import type { DetailBudget } from '../stages/detail-budget.js';
import { DETAIL_NUMBERS } from './chunk-detail.js';
import type { PackedLevels } from './packed-levels.js';

/**
 * A scene on the GPU with additional levels of detail. It shares the splats of the scene, and has the coarser splats in
 * extra blocks. If the setting `detail` is 0 without a splat budget, the image equals that of the scene byte for byte.
 */
export class DetailedGaussians extends SceneBuffers {
  readonly blocks: readonly GaussianBlock[];
  readonly #leaves: GaussianScene;
  readonly #coarser: GaussianBuffers;
  readonly detailBudget: DetailBudget | undefined;

  private constructor(memory: GpuMemory, leaves: GaussianScene, details: Float32Array, coarser: GaussianBuffers) {
    super(memory, leaves, leaves.count + coarser.count);
    this.#leaves = leaves;
    this.#coarser = coarser;
    this.detailBudget = coarser.detailBudget;
    this.blocks = [...withDetails(leaves.blocks, details, memory), ...coarser.blocks];
  }

  /**
   * Adds levels to a scene on the GPU. The caller keeps the scene, which must outlive the result.
   * @param leaves The scene, which becomes the finest level.
   * @param levels Levels that `buildPackedLevels` built from exactly this scene.
   * @throws GaussianSplatError `out-of-memory/budget` if the levels alone exceed `memoryBudget`;
   * `out-of-memory/allocation` if the device has too little memory.
   */
  static async upload(
    device: GPUDevice,
    leaves: GaussianScene,
    { leafDetails, coarser }: PackedLevels,
    options: UploadOptions = {},
  ): Promise<DetailedGaussians> {
    const own = await GaussianBuffers.upload(device, coarser, options);
    try {
      const what = `levels of detail of ${leaves.count} splats`;
      return await withMemoryCheck(device, what, (memory) => new DetailedGaussians(memory, leaves, leafDetails, own));
    } catch (error) {
      own.destroy();
      throw error;
    }
  }

  get version(): number {
    return this.#leaves.version;
  }

  /** Bytes of GPU memory of the levels, without the scene itself. */
  override get byteLength(): number {
    return super.byteLength + this.#coarser.byteLength;
  }

  /** Frees the levels, but not the scene. */
  override destroy(): void {
    super.destroy();
    this.#coarser.destroy();
  }
}

/** Returns the same blocks, each with the detail rows of its chunks. */
function withDetails(blocks: readonly GaussianBlock[], details: Float32Array, memory: GpuMemory): GaussianBlock[] {
  const words = new Uint32Array(details.buffer, details.byteOffset, details.length);
  const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination | BUFFER_USAGE.copySource;
  let start = 0;
  return blocks.map((page) => {
    const end = start + DETAIL_NUMBERS * Math.ceil(page.count / constants.CULL_GROUP);
    const rows = memory.buffer('gs.gaussians.details', 4 * (end - start), usage, words.subarray(start, end));
    start = end;
    return { ...page, details: rows };
  });
}
