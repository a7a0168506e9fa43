import type { Camera } from '@gaussian-splat/core';
import type { GaussianScene, Viewpoint } from '@gaussian-splat/renderer';
import {
  BUFFER_USAGE,
  GpuMemory,
  rareKernelOf,
  TEXTURE_USAGE,
  submitPass,
  uniformWith,
} from '@gaussian-splat/renderer/stages';
import { untilItHasRoom, readBack } from '@gaussian-splat/renderer/tools';
import * as generated from '../generated/shaders.js';
import { show } from './show.js';

const { ERROR_TILE, imageError: imageError, imageErrorSum: imageErrorSum, ImageErrors: layout } = generated;
/** Bytes of a sum of squares and a number of pixels. */
const SUM_BYTES = 8;
const COUNTS_BYTES = 16;
/** Divisor of the number of tiles of each view, because bindings are aligned to 256 bytes. */
const ALIGNED_TILES = 256 / SUM_BYTES;

/** A view, and its reference image. `columns` and `rows` are its number of tiles. */
export interface Exhibit {
  readonly camera: Camera;
  readonly reference: GPUTexture;
  readonly columns: number;
  readonly rows: number;
  readonly compare: GPUBindGroup;
}

/**
 * Measures errors of images of a scene against images of a reference scene in the same views. Images remain on the GPU.
 * For each image, only a sum of squares and a number of pixels are read back, in one read for all images.
 */
export class ImageErrors {
  readonly #device: GPUDevice;
  readonly #viewpoint: Viewpoint;
  readonly #memory: GpuMemory;
  /** Target textures by their size in pixels. */
  readonly #targets = new Map<string, GPUTexture>();
  readonly #exhibits: readonly Exhibit[];
  #covered: readonly number[] = [];
  readonly #errors: GPUBuffer;
  readonly #counts: GPUBuffer;
  readonly #sum: GPUBindGroup;

  private constructor(device: GPUDevice, viewpoint: Viewpoint, views: readonly Camera[]) {
    this.#device = device;
    this.#viewpoint = viewpoint;
    this.#memory = new GpuMemory(device);
    const { storage, copySource, copyDestination } = BUFFER_USAGE;
    const buffer = (name: string, bytes: number, usage: number): GPUBuffer =>
      this.#memory.buffer(`gs.optimize.${name}`, bytes, usage);
    const tilesOf = ({ width, height }: Camera): number =>
      Math.ceil(width / ERROR_TILE) * Math.ceil(height / ERROR_TILE);
    const room = ALIGNED_TILES * Math.ceil(Math.max(...views.map(tilesOf)) / ALIGNED_TILES);
    const tiles = buffer('tile_errors', SUM_BYTES * room * views.length, storage);
    this.#errors = buffer('errors', SUM_BYTES * views.length, storage | copySource);
    this.#counts = buffer('counts', COUNTS_BYTES * views.length, copySource | copyDestination);
    const images = uniformWith(this.#memory, 'gs.optimize.images', layout, { tiles: room });
    this.#sum = rareKernelOf(device, imageErrorSum).bind({ images, tiles, errors: this.#errors });
    const size = SUM_BYTES * room;
    this.#exhibits = views.map((camera, k) => this.#exhibit(camera, { buffer: tiles, offset: size * k, size }));
  }

  /**
   * Allocates textures, and draws the reference images.
   * @param gaussians Reference scene.
   */
  static async of(
    device: GPUDevice,
    viewpoint: Viewpoint,
    gaussians: GaussianScene,
    views: readonly Camera[],
  ): Promise<ImageErrors> {
    const made = new ImageErrors(device, viewpoint, views);
    try {
      const sums = new Float32Array(await made.#draw(gaussians, ({ reference }) => reference));
      made.#covered = views.map((_, k) => sums[2 * k + 1]);
      return made;
    } catch (error) {
      made.destroy();
      throw error;
    }
  }

  /** Views, and their reference images. */
  get exhibits(): readonly Exhibit[] {
    return this.#exhibits;
  }

  /** Number of pixels that each reference image covers, [views]. */
  get covered(): readonly number[] {
    return this.#covered;
  }

  /**
   * Returns the mean squared error of colors, peak 1, over the pixels that the reference image covers. Views whose
   * reference covers no pixel are omitted.
   */
  async measure(gaussians: GaussianScene): Promise<number[]> {
    const sums = new Float32Array(await this.#draw(gaussians, ({ camera }) => this.targetOf(camera)));
    return this.#covered.flatMap((pixels, k) => (pixels === 0 ? [] : [sums[2 * k] / (3 * pixels)]));
  }

  destroy(): void {
    this.#memory.destroy();
    for (const { reference } of this.#exhibits) reference.destroy();
    for (const target of this.#targets.values()) target.destroy();
  }

  #exhibit(camera: Camera, tiles: GPUBufferBinding): Exhibit {
    const reference = this.#texture(camera, 'gs.optimize.reference');
    const image = this.targetOf(camera).createView();
    return {
      ...{ camera, reference },
      columns: Math.ceil(camera.width / ERROR_TILE),
      rows: Math.ceil(camera.height / ERROR_TILE),
      compare: rareKernelOf(this.#device, imageError).bind({ image, reference: reference.createView(), tiles }),
    };
  }

  /** Returns the target texture for the size of a view. */
  targetOf(camera: Camera): GPUTexture {
    const key = `${camera.width} x ${camera.height}`;
    const target = this.#targets.get(key) ?? this.#texture(camera, 'gs.optimize.picture');
    this.#targets.set(key, target);
    return target;
  }

  #texture({ width, height }: Camera, label: string): GPUTexture {
    const { storageBinding, textureBinding, renderAttachment } = TEXTURE_USAGE;
    return this.#device.createTexture({
      label,
      size: [width, height],
      format: 'rgba32float',
      usage: storageBinding | textureBinding | renderAttachment,
    });
  }

  /**
   * Draws all views, and repeats this if the capacity was not sufficient.
   * @returns For each view, a sum of squares and a number of pixels, float32.
   */
  async #draw(gaussians: GaussianScene, targetOf: (exhibit: Exhibit) => GPUTexture): Promise<ArrayBuffer> {
    let sums = new ArrayBuffer(0);
    show(this.#viewpoint, gaussians);
    await untilItHasRoom(async () => {
      for (const [k, exhibit] of this.#exhibits.entries()) {
        this.#viewpoint.draw(exhibit.camera, { target: targetOf(exhibit) });
        this.#compare(exhibit, k);
      }
      this.#addUp();
      const [found, counts] = await readBack(this.#device, [{ buffer: this.#errors }, { buffer: this.#counts }]);
      sums = found;
      // All views are tested, because each call also records the missing capacity of its view.
      const hadRoom = this.#exhibits.map((_, k) =>
        this.#viewpoint.hadRoom(new Uint32Array(counts, COUNTS_BYTES * k, 4)),
      );
      return !hadRoom.includes(false);
    });
    return sums;
  }

  #compare({ columns, rows, compare }: Exhibit, k: number): void {
    const encoder = this.#device.createCommandEncoder({ label: 'gs.optimize.compare' });
    this.#viewpoint.copyCounts(encoder, this.#counts, COUNTS_BYTES * k);
    const kernel = rareKernelOf(this.#device, imageError);
    const record = (pass: GPUComputePassEncoder): void => kernel.dispatchGrid(pass, compare, columns, rows);
    submitPass(this.#device, 'gs.optimize.compare', record, encoder);
  }

  #addUp(): void {
    submitPass(this.#device, 'gs.optimize.add_up', (pass) =>
      rareKernelOf(this.#device, imageErrorSum).dispatchGrid(pass, this.#sum, this.#exhibits.length, 1),
    );
  }
}
