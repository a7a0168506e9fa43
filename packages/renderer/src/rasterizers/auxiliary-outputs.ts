/** Rasterizes tiles with auxiliary outputs. */
import { rasterizeTilesAuxiliary, rasterizeTilesAuxiliaryFew } from '../generated/auxiliary-shaders.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, perDevice, TEXTURE_USAGE } from '../gpu/kernel.js';
import type {
  AuxiliaryFrame,
  AuxiliaryOutputs as AuxiliaryOutputsOf,
  AuxiliaryTargets,
  AuxiliaryTilePainter,
} from './rasterizer.js';
import {
  rasterizeKernel,
  type FewStage,
  type PaintedTiles,
  type RasterizeKernel,
  type RasterizeVariant,
} from './tile-kernels.js';
import { BoundImages } from './tile-painter.js';

/**
 * Auxiliary outputs of a frame: see {@link AuxiliaryTargets}. Few pages use them, so their code is loaded with this
 * class.
 */
export class AuxiliaryOutputs implements AuxiliaryOutputsOf {
  readonly #targets: AuxiliaryTargets;

  constructor(targets: AuxiliaryTargets = {}) {
    this.#targets = targets;
  }

  painter(device: GPUDevice, survivors: GPUBuffer): AuxiliaryTilePainter {
    return new AuxiliaryPainter(device, this.#targets, survivors);
  }
}

/** Rasterizes tiles, and also writes auxiliary outputs. */
class AuxiliaryPainter implements AuxiliaryTilePainter {
  readonly tile = constants.TILE;
  readonly #device: GPUDevice;
  readonly #outputs: AuxiliaryTargets;
  readonly #survivors: GPUBuffer;
  #frame: AuxiliaryFrame | undefined;

  /** @param survivors Indices of the visible splats by slot. */
  constructor(device: GPUDevice, outputs: AuxiliaryTargets, survivors: GPUBuffer) {
    this.#device = device;
    this.#outputs = outputs;
    this.#survivors = survivors;
  }

  /** Inputs of the frame's rasterization; undefined before the frame is recorded. */
  get frame(): AuxiliaryFrame | undefined {
    return this.#frame;
  }

  kernel(variant: RasterizeVariant): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTilesAuxiliary, variant);
  }

  few(variant: RasterizeVariant, stage: FewStage): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTilesAuxiliaryFew, variant, { stage });
  }

  /** Returns new bindings for each frame. They are not cached, because few frames have auxiliary outputs. */
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

/** Placeholders for auxiliary outputs that the caller did not request. */
const unusedOutputs = (device: GPUDevice): Required<AuxiliaryTargets> =>
  perDevice(device, 'unused outputs', () => ({
    contributions: device.createBuffer({ label: 'gs.no_contributions', size: 4, usage: BUFFER_USAGE.storage }),
    depth: device.createTexture({
      ...{ label: 'gs.no_depth', size: [1, 1], format: 'r32float' as const },
      usage: TEXTURE_USAGE.storageBinding,
    }),
  }));
