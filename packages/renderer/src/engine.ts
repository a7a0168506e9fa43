import type { Camera } from '@gaussian-splat/core';
import { AccumulationTexture } from './accumulation.js';
import { makeStages, type Stages } from './bindings.js';
import { FrameResources } from './frame-resources.js';
import { QuadsRasterizer } from './rasterizers/quads.js';
import type { Rasterizer } from './rasterizers/rasterizer.js';
import { TilesRasterizer } from './rasterizers/tiles.js';
import type { RenderSettings } from './render-settings.js';
import { requireBlendable } from './requirements.js';
import type { ComposeBindings } from './stages/compose.js';
import type { Variants } from './variants.js';

/**
 * Accumulation texture of an image size, and the bindings that compose it over the target. Used if the rasterizer
 * cannot write to the target.
 */
export interface Accumulation {
  readonly texture: AccumulationTexture;
  readonly compose: ComposeBindings;
}

/** Resources that depend on the rasterizer, the accumulation format, and the workgroup variant of the stages. */
export class Engine {
  readonly settings: RenderSettings & Variants;
  readonly stages: Stages;
  readonly rasterizer: Rasterizer;
  readonly resources: FrameResources;
  readonly #device: GPUDevice;
  /** Cached textures, keyed by size; the most recently used one is last. */
  readonly #accumulations = new Map<string, Accumulation>();

  /** @throws GaussianSplatError `unsupported/limits` if the variant needs a feature that the device lacks. */
  constructor(
    device: GPUDevice,
    settings: RenderSettings & Variants,
    needs: { readonly pairsAtOnce: () => number; readonly onIncomplete: () => void },
  ) {
    this.#device = device;
    this.settings = settings;
    this.stages = makeStages(device, settings);
    this.rasterizer = makeRasterizer(device, settings);
    this.resources = new FrameResources(device, { stages: this.stages, rasterizer: this.rasterizer, ...needs });
  }

  /** Whether this engine can draw frames with these settings. */
  serves({ rasterizer, accumulation, threads }: Variants): boolean {
    const { settings } = this;
    return rasterizer === settings.rasterizer && accumulation === settings.accumulation && threads === settings.threads;
  }

  get byteLength(): number {
    const textures = [...this.#accumulations.values()].map(({ texture }) => texture);
    return [this.resources, this.rasterizer, ...textures].reduce((sum, { byteLength }) => sum + byteLength, 0);
  }

  /**
   * Returns the accumulation of an image size.
   * @param max Maximum number of cached sizes.
   * @param bind Creates the bindings for the texture of a new size.
   */
  accumulationOf(
    { width, height }: Pick<Camera, 'width' | 'height'>,
    max: number,
    bind: (accumulated: GPUTextureView) => ComposeBindings,
  ): Accumulation {
    const all = this.#accumulations;
    const key = `${width} ${height}`;
    let found = all.get(key);
    all.delete(key);
    if (!found) {
      for (const [old, { texture }] of all) {
        if (all.size < max) break;
        texture.destroy();
        all.delete(old);
      }
      const texture = new AccumulationTexture(this.#device, this.settings.accumulation, width, height);
      found = { texture, compose: bind(texture.view) };
    }
    all.set(key, found);
    return found;
  }

  destroy(): void {
    this.resources.release();
    this.rasterizer.destroy();
    for (const { texture } of this.#accumulations.values()) texture.destroy();
  }
}

function makeRasterizer(device: GPUDevice, { rasterizer, accumulation, threads }: Variants): Rasterizer {
  if (rasterizer === 'tiles') return new TilesRasterizer(device, accumulation, threads);
  requireBlendable(device, accumulation);
  return new QuadsRasterizer(device, accumulation);
}
