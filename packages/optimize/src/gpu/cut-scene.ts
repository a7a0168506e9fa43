import type { GaussianBlock } from '@gaussian-splat/renderer/tools';
import {
  BUFFER_USAGE,
  type GpuMemory,
  rareKernelOf,
  SceneBuffers,
  withMemoryCheck,
  submitPass,
  writeUniform,
} from '@gaussian-splat/renderer/stages';
import { readBack } from '@gaussian-splat/renderer/tools';
import { optimizeCut, GONE, SCORE_GROUP, UNJUDGED } from '../generated/shaders.js';
import type { Cut } from '../reduce.js';
import { layouts } from './layouts.js';
import type { ScenePart, SceneParts } from './scene-parts.js';

const DEGREES = 4;

/**
 * A copy of a scene on the GPU that cuts modify. Removed splats become transparent, and colors lose bands. The
 * bounds of chunks do not change.
 */
export class CutScene extends SceneBuffers {
  readonly blocks: readonly GaussianBlock[];
  readonly #device: GPUDevice;
  readonly #scene: SceneParts;
  readonly #uniforms: readonly GPUBuffer[];
  readonly #kept: GPUBuffer;
  /** For each part of the scene, the degree that each splat keeps, or GONE if it is removed. */
  readonly #choices: readonly GPUBuffer[];
  readonly #bindings: readonly GPUBindGroup[];
  #version = 0;

  private constructor(device: GPUDevice, memory: GpuMemory, scene: SceneParts) {
    super(memory, scene.gaussians, scene.gaussians.count);
    this.#device = device;
    this.#scene = scene;
    const { uniform, storage, copySource, copyDestination } = BUFFER_USAGE;
    const copyOf = (name: string, buffer: GPUBuffer): GPUBuffer =>
      memory.buffer(`gs.optimize.cut_${name}`, buffer.size, storage | copySource);
    this.blocks = scene.parts.map(({ page }) => ({
      ...page,
      geometry: copyOf('geometry', page.geometry),
      sh: copyOf('sh', page.sh),
    }));
    this.#kept = memory.buffer('gs.optimize.kept', 4 * DEGREES, storage | copySource | copyDestination);
    this.#choices = scene.parts.map(({ page }) =>
      memory.buffer('gs.optimize.choices', 4 * page.count, storage | copySource),
    );
    this.#uniforms = scene.parts.map(() =>
      memory.buffer('gs.optimize.cut', layouts.Cut.size, uniform | copyDestination),
    );
    this.#bindings = scene.parts.map((part, p) => this.#bind(part, p));
  }

  /** Allocates the copy of a scene. @throws GaussianSplatError `out-of-memory/*` */
  static of(device: GPUDevice, scene: SceneParts): Promise<CutScene> {
    const where = `copy of a scene of ${scene.gaussians.count} splats`;
    return withMemoryCheck(device, where, (memory) => new CutScene(device, memory, scene));
  }

  get version(): number {
    return this.#version;
  }

  /** Applies a cut to the original scene, and writes the result to the copy. Splats must have been scored before. */
  apply({ minContribution = 0, removalPrice = 0, colorPrice = 0 }: Cut): void {
    const kernel = rareKernelOf(this.#device, optimizeCut);
    const prices = {
      min_contribution: minContribution,
      // WGSL has no infinity. UNJUDGED is its substitute in scores.
      removal_price: Math.min(removalPrice, UNJUDGED),
      color_price: colorPrice,
    };
    const encoder = this.#device.createCommandEncoder({ label: 'gs.optimize.cut' });
    encoder.clearBuffer(this.#kept);
    const record = (pass: GPUComputePassEncoder): void =>
      this.#scene.parts.forEach(({ page }, p) => {
        const values = { ...prices, splat_count: page.count, sh_degree: this.shDegree };
        writeUniform(this.#device, this.#uniforms[p], layouts.Cut, values);
        kernel.dispatch(pass, this.#bindings[p], Math.ceil(page.count / SCORE_GROUP));
      });
    submitPass(this.#device, 'gs.optimize.cut', record, encoder);
    this.#version++;
  }

  /** Returns the number of splats of each degree after the last cut, [4]. */
  async degrees(): Promise<number[]> {
    const [counts] = await readBack(this.#device, [{ buffer: this.#kept, byteLength: 4 * DEGREES }]);
    return [...new Uint32Array(counts)];
  }

  /**
   * Returns the result of the last cut: ascending indices of the remaining splats, and for all splats of the scene the
   * degree that they keep (0 for removed ones).
   */
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

  #bind({ page, scores, lowered }: ScenePart, p: number): GPUBindGroup {
    const { geometry, sh } = this.blocks[p];
    return rareKernelOf(this.#device, optimizeCut).bind({
      ...{ cut: this.#uniforms[p], gaussians: page.geometry, sh: page.sh, scores, lowered },
      ...{ cut_gaussians: geometry, cut_sh: sh, kept: this.#kept, choices: this.#choices[p] },
    });
  }
}
