/** The ways to paint tiles: one is chosen for each frame. */
import { constants, rasterizeTiles, rasterizeTilesAuxiliary } from '../generated/shaders.js';
import { BUFFER_USAGE, perDevice, TEXTURE_USAGE, type Resource } from '../gpu/kernel.js';
import type { AuxiliaryFrame, AuxiliaryOutputs } from './rasterizer.js';
import { rasterizeKernel, type PaintedTiles, type RasterizeKernel, type RasterizeVariant } from './tile-kernels.js';

/** A way to paint tiles. */
export interface TilePainter {
  /** Side of its tiles, pixels. */
  readonly tile: number;
  kernel(variant: RasterizeVariant): RasterizeKernel;
  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup;
}

/** Bind groups by the image that is painted into, made anew when something else is bound. */
export class BoundImages {
  readonly #known = new WeakMap<GPUTextureView, { readonly key: readonly unknown[]; readonly group: GPUBindGroup }>();

  /** @param more what the kernel binds besides */
  bind(kernel: RasterizeKernel, painted: PaintedTiles, more: Readonly<Record<string, Resource>> = {}): GPUBindGroup {
    const resources = { ...painted, ...more };
    const key = [kernel, ...Object.values(resources)];
    const known = this.#known.get(painted.image);
    if (known?.key.length === key.length && known.key.every((value, k) => value === key[k])) return known.group;
    const group = kernel.bind(resources);
    this.#known.set(painted.image, { key, group });
    return group;
  }
}

/** Paints splats and nothing else. */
export class PlainPainter implements TilePainter {
  readonly tile = constants.TILE;
  readonly #device: GPUDevice;
  readonly #bound = new BoundImages();

  constructor(device: GPUDevice) {
    this.#device = device;
  }

  kernel(variant: RasterizeVariant): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTiles, variant);
  }

  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup {
    return this.#bound.bind(kernel, painted);
  }
}

/** Writes auxiliary outputs besides. */
export class AuxiliaryPainter implements TilePainter {
  readonly tile = constants.TILE;
  readonly #device: GPUDevice;
  readonly #outputs: AuxiliaryOutputs;
  readonly #survivors: GPUBuffer;
  #frame: AuxiliaryFrame | undefined;

  /** @param survivors numbers of the visible splats by slot */
  constructor(device: GPUDevice, outputs: AuxiliaryOutputs, survivors: GPUBuffer) {
    this.#device = device;
    this.#outputs = outputs;
    this.#survivors = survivors;
  }

  /** What the frame was painted from; undefined before it is recorded. */
  get frame(): AuxiliaryFrame | undefined {
    return this.#frame;
  }

  kernel(variant: RasterizeVariant): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTilesAuxiliary, variant);
  }

  /** Bound anew for each frame: few frames have auxiliary outputs. */
  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup {
    const unused = unusedOutputs(this.#device);
    const { contributions = unused.contributions, depth = unused.depth } = this.#outputs;
    this.#frame = { ...(painted as PaintedTiles & AuxiliaryFrame), survivors: this.#survivors };
    return new BoundImages().bind(kernel, painted, {
      ...{ survivors: this.#survivors, contributions },
      depths: depth.createView(),
    });
  }
}

/** Where auxiliary outputs go that no caller asked for. */
const unusedOutputs = (device: GPUDevice): Required<AuxiliaryOutputs> =>
  perDevice(device, 'unused outputs', () => ({
    contributions: device.createBuffer({ label: 'gs.no_contributions', size: 4, usage: BUFFER_USAGE.storage }),
    depth: device.createTexture({
      ...{ label: 'gs.no_depth', size: [1, 1], format: 'r32float' as const },
      usage: TEXTURE_USAGE.storageBinding,
    }),
  }));
