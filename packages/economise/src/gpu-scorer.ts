import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packedOrder, packGaussians, Renderer } from '@gaussian-splat/renderer';
import type { ContributionScorer, Contributions } from './scorer.js';

/** Values of GPUBufferUsage and GPUTextureUsage, which Node has only where Dawn was loaded. */
const [MAP_READ, COPY_SOURCE, COPY_DESTINATION, STORAGE] = [1, 4, 8, 128];
const RENDER_ATTACHMENT = 16;

/**
 * Squared difference of a splat's colour to what lies behind it, a channel: an assumption, on the low side of the means of captured scenes (0.05 to 0.16). It shifts
 * only what is tried first; what a cut costs is measured on pictures.
 */
const USUAL_CONTRAST = 0.02;

/** Splats of a chunk: the buffer of contributions has whole ones. */
const CHUNK = 256;

/**
 * Scores with the project's compute rasterizer, which notes the largest weight of every splat as it paints. Energies are not noted; they
 * are those of an ellipse of that peak and the splat's size on the screen. Nor is what lies behind: as if it differed from every splat by as much.
 */
export class GpuScorer {
  readonly #device: GPUDevice;
  readonly #cloud: GaussianCloud;
  readonly #gaussians: GaussianBuffers;
  readonly #renderer: Renderer;
  readonly #order: Uint32Array;
  readonly #noted: GPUBuffer;
  readonly #staging: GPUBuffer;
  readonly #result: Contributions;

  private constructor(device: GPUDevice, cloud: GaussianCloud, gaussians: GaussianBuffers) {
    this.#device = device;
    this.#cloud = cloud;
    this.#gaussians = gaussians;
    this.#renderer = new Renderer(device, { rasterizer: 'tiles' });
    this.#order = packedOrder(cloud);
    const size = 4 * CHUNK * Math.ceil(cloud.count / CHUNK);
    const usage = STORAGE | COPY_SOURCE | COPY_DESTINATION;
    this.#noted = device.createBuffer({ label: 'gs.economise.contributions', size, usage });
    this.#staging = device.createBuffer({ label: 'gs.economise.read', size, usage: MAP_READ | COPY_DESTINATION });
    const none = (): Float32Array => new Float32Array(cloud.count);
    this.#result = { peak: none(), energy: none(), removal: none() };
  }

  /** @throws GaussianSplatError `out-of-memory/*` */
  static async create(device: GPUDevice, cloud: GaussianCloud): Promise<GpuScorer> {
    return new GpuScorer(device, cloud, await GaussianBuffers.upload(device, packGaussians(cloud)));
  }

  /** Scores one view. */
  readonly score: ContributionScorer = async (camera) => {
    const { width, height } = camera;
    const target = this.#device.createTexture({
      size: [width, height],
      format: 'rgba16float',
      usage: RENDER_ATTACHMENT,
    });
    try {
      // Drawn again where buffers had no room for all of it; larger weights stay.
      this.#device.queue.writeBuffer(this.#noted, 0, new Uint8Array(this.#noted.size));
      for (let tries = 0; tries < 4; tries++) {
        const notes = { contributions: this.#noted };
        this.#renderer.render({ gaussians: this.#gaussians, camera, target, notes });
        if (await this.#renderer.isComplete()) break;
      }
    } finally {
      target.destroy();
    }
    await this.#read(camera);
    return this.#result;
  };

  async #read(camera: Camera): Promise<void> {
    const encoder = this.#device.createCommandEncoder({ label: 'gs.economise.read' });
    encoder.copyBufferToBuffer(this.#noted, 0, this.#staging, 0, this.#noted.size);
    this.#device.queue.submit([encoder.finish()]);
    await this.#staging.mapAsync(MAP_READ);
    const weights = new Float32Array(this.#staging.getMappedRange());
    const { peak, energy, removal } = this.#result;
    for (const values of [peak, energy, removal]) values.fill(0);
    for (let slot = 0; slot < this.#order.length; slot++) {
      if (weights[slot] === 0) continue;
      const i = this.#order[slot];
      peak[i] = weights[slot];
      energy[i] = weights[slot] ** 2 * screenArea(this.#cloud, i, camera);
      removal[i] = USUAL_CONTRAST * energy[i];
    }
    this.#staging.unmap();
  }

  destroy(): void {
    this.#renderer.destroy();
    this.#gaussians.destroy();
    this.#noted.destroy();
    this.#staging.destroy();
  }
}

/** The integral of a squared Gaussian of peak 1 as large as a splat on the screen, in parts of the image: pi times its two largest axes. */
function screenArea({ positions, origin, scales }: GaussianCloud, i: number, camera: Camera): number {
  const { worldToCamera: m, fx, fy, width, height } = camera;
  const at = (axis: number): number => positions[3 * i + axis] + origin[axis];
  const z = m[8] * at(0) + m[9] * at(1) + m[10] * at(2) + m[11];
  const [a, b, c] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
  // 0.3 px² is the dilation of every splat.
  const area = (Math.max(a * b, b * c, c * a) * fx * fy) / (z * z) + 0.3;
  return Math.min(1, (Math.PI * area) / (width * height));
}
