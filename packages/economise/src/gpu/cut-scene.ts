import type { GaussianScene } from '@gaussian-splat/renderer';
import type { GaussianBlock } from '@gaussian-splat/renderer/tools';
import { BUFFER_USAGE, GpuMemory, rareKernelOf, withMemoryCheck, writeStruct } from '@gaussian-splat/renderer/stages';
import { readBack } from '@gaussian-splat/renderer/tools';
import { economiseCut, GONE, SCORE_GROUP, UNJUDGED } from '../generated/shaders.js';
import type { Cut } from '../reduce.js';
import { layouts } from './layouts.js';
import type { ScenePart, SceneParts } from './scene-parts.js';

const DEGREES = 4;

/**
 * A copy of a scene on the GPU that cuts are applied to: removed splats become transparent, and colors lose bands.
 * Chunks keep their bounds.
 */
export class CutScene implements GaussianScene {
  readonly pages: readonly GaussianBlock[];
  readonly #device: GPUDevice;
  readonly #scene: SceneParts;
  readonly #memory: GpuMemory;
  readonly #uniforms: readonly GPUBuffer[];
  readonly #kept: GPUBuffer;
  /** For each part: the degree that each splat keeps, or GONE. */
  readonly #choices: readonly GPUBuffer[];
  readonly #bindings: readonly GPUBindGroup[];
  #version = 0;

  private constructor(device: GPUDevice, scene: SceneParts, memory: GpuMemory) {
    this.#device = device;
    this.#scene = scene;
    this.#memory = memory;
    const { uniform, storage, copySource, copyDestination } = BUFFER_USAGE;
    const copyOf = (name: string, buffer: GPUBuffer): GPUBuffer =>
      memory.buffer(`gs.economise.cut_${name}`, buffer.size, storage | copySource);
    this.pages = scene.parts.map(({ page }) => ({
      ...page,
      geometry: copyOf('geometry', page.geometry),
      sh: copyOf('sh', page.sh),
    }));
    this.#kept = memory.buffer('gs.economise.kept', 4 * DEGREES, storage | copySource | copyDestination);
    this.#choices = scene.parts.map(({ page }) =>
      memory.buffer('gs.economise.choices', 4 * page.count, storage | copySource),
    );
    this.#uniforms = scene.parts.map(() =>
      memory.buffer('gs.economise.cut', layouts.Cut.size, uniform | copyDestination),
    );
    this.#bindings = scene.parts.map((part, p) => this.#bind(part, p));
  }

  /** @throws GaussianSplatError `out-of-memory/*` */
  static async of(device: GPUDevice, scene: SceneParts): Promise<CutScene> {
    const memory = new GpuMemory(device);
    try {
      const where = `copy of a scene of ${scene.gaussians.count} splats`;
      return await withMemoryCheck(device, where, () => new CutScene(device, scene, memory));
    } catch (error) {
      memory.destroy();
      throw error;
    }
  }

  get count(): number {
    return this.#scene.gaussians.count;
  }
  get shDegree(): GaussianScene['shDegree'] {
    return this.#scene.gaussians.shDegree;
  }
  get shPrecision(): GaussianScene['shPrecision'] {
    return this.#scene.gaussians.shPrecision;
  }
  get antialiased(): boolean {
    return this.#scene.gaussians.antialiased;
  }

  get filterVariance(): number | undefined {
    return this.#scene.gaussians.filterVariance;
  }
  get origin(): GaussianScene['origin'] {
    return this.#scene.gaussians.origin;
  }
  get version(): number {
    return this.#version;
  }

  /** Applies a cut to the whole scene. Splats must have been scored. */
  apply({ minContribution = 0, removalPrice = 0, colorPrice = 0 }: Cut): void {
    const kernel = rareKernelOf(this.#device, economiseCut);
    const bytes = new ArrayBuffer(layouts.Cut.size);
    const prices = {
      min_contribution: minContribution,
      // WGSL has no infinity.
      removal_price: Math.min(removalPrice, UNJUDGED),
      color_price: colorPrice,
    };
    const encoder = this.#device.createCommandEncoder({ label: 'gs.economise.cut' });
    encoder.clearBuffer(this.#kept);
    const pass = encoder.beginComputePass({ label: 'gs.economise.cut' });
    this.#scene.parts.forEach(({ page }, p) => {
      writeStruct(layouts.Cut, { ...prices, splat_count: page.count, sh_degree: this.shDegree }, bytes);
      this.#device.queue.writeBuffer(this.#uniforms[p], 0, bytes);
      kernel.dispatch(pass, this.#bindings[p], Math.ceil(page.count / SCORE_GROUP));
    });
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
    this.#version++;
  }

  /** [4] number of splats after the last cut, by the degree that they keep. */
  async degrees(): Promise<number[]> {
    const [counts] = await readBack(this.#device, [{ buffer: this.#kept, byteLength: 4 * DEGREES }]);
    return [...new Uint32Array(counts)];
  }

  /** Result of the last cut: indices of remaining splats, and the degree of each of the scene's splats. */
  async choice(): Promise<{ staying: Uint32Array; degrees: Uint8Array }> {
    const parts = this.#scene.parts.map(({ page }, p) => ({ buffer: this.#choices[p], byteLength: 4 * page.count }));
    const staying = new Uint32Array(this.count);
    const degrees = new Uint8Array(this.count);
    let [length, i] = [0, 0];
    for (const choices of (await readBack(this.#device, parts)).map((bytes) => new Uint32Array(bytes))) {
      for (let k = 0; k < choices.length; k++, i++) {
        if (choices[k] === GONE) continue;
        staying[length++] = i;
        degrees[i] = choices[k];
      }
    }
    return { staying: staying.subarray(0, length), degrees };
  }

  destroy(): void {
    this.#memory.destroy();
  }

  #bind({ page, scores, lowered }: ScenePart, p: number): GPUBindGroup {
    const { geometry, sh } = this.pages[p];
    return rareKernelOf(this.#device, economiseCut).bind({
      ...{ cut: this.#uniforms[p], gaussians: page.geometry, sh: page.sh, scores, lowered },
      ...{ cut_gaussians: geometry, cut_sh: sh, kept: this.#kept, choices: this.#choices[p] },
    });
  }
}
