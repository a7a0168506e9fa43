import type { GaussianBuffers, GaussianPage, GaussianScene } from '@gaussian-splat/renderer';
import { BUFFER_USAGE, GpuMemory, rareKernelOf, withMemoryCheck, writeStruct } from '@gaussian-splat/renderer/stages';
import { economiseMask, Mask as layout, SCORE_GROUP } from '../generated/shaders.js';

/** A scene of which any splats can be left out, on the GPU: their geometry is copied, all else is the scene's own. */
export class MaskScene implements GaussianScene {
  readonly count: number;
  readonly shDegree: GaussianScene['shDegree'];
  readonly shPrecision: GaussianScene['shPrecision'];
  readonly antialiased: boolean;
  readonly filterVariance: number | undefined;
  readonly origin: GaussianScene['origin'];
  readonly pages: readonly GaussianPage[];
  readonly #device: GPUDevice;
  readonly #memory: GpuMemory;
  readonly #kept: GPUBuffer;
  readonly #bindings: readonly GPUBindGroup[];
  #version = 0;

  private constructor(device: GPUDevice, scene: GaussianBuffers, memory: GpuMemory) {
    ({
      count: this.count,
      shDegree: this.shDegree,
      shPrecision: this.shPrecision,
      antialiased: this.antialiased,
      filterVariance: this.filterVariance,
      origin: this.origin,
    } = scene);
    this.#device = device;
    this.#memory = memory;
    const { storage, uniform, copyDestination } = BUFFER_USAGE;
    this.#kept = memory.buffer('gs.economise.kept', 4 * Math.ceil(this.count / 32), storage | copyDestination);
    let first = 0;
    const made = scene.pages.map((page) => {
      const geometry = memory.buffer('gs.economise.masked', page.geometry.size, storage);
      const mask = memory.buffer('gs.economise.mask', layout.size, uniform | copyDestination);
      const bytes = new ArrayBuffer(layout.size);
      writeStruct(layout, { splat_count: page.count, first }, bytes);
      device.queue.writeBuffer(mask, 0, bytes);
      first += page.count;
      const resources = { mask, gaussians: page.geometry, kept: this.#kept, masked: geometry };
      return { page: { ...page, geometry }, bindings: rareKernelOf(device, economiseMask).bind(resources) };
    });
    this.pages = made.map(({ page }) => page);
    this.#bindings = made.map(({ bindings }) => bindings);
  }

  /** @throws GaussianSplatError `out-of-memory/*` */
  static async of(device: GPUDevice, scene: GaussianBuffers): Promise<MaskScene> {
    const memory = new GpuMemory(device);
    try {
      return await withMemoryCheck(
        device,
        `mask of a scene of ${scene.count} splats`,
        () => new MaskScene(device, scene, memory),
      );
    } catch (error) {
      memory.destroy();
      throw error;
    }
  }

  get version(): number {
    return this.#version;
  }

  /** Shows these splats and no others. */
  show(slots: Uint32Array): void {
    const bits = new Uint32Array(Math.ceil(this.count / 32));
    for (const slot of slots) bits[slot >>> 5] |= 1 << (slot & 31);
    this.#device.queue.writeBuffer(this.#kept, 0, bits);
    const kernel = rareKernelOf(this.#device, economiseMask);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.economise.mask' });
    const pass = encoder.beginComputePass({ label: 'gs.economise.mask' });
    this.pages.forEach(({ count }, p) => kernel.dispatch(pass, this.#bindings[p], Math.ceil(count / SCORE_GROUP)));
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
    this.#version++;
  }

  destroy(): void {
    this.#memory.destroy();
  }
}
