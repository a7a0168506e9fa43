/** Rasterizes tiles with auxiliary outputs. */
import { rasterizeTilesAuxiliary, rasterizeTilesAuxiliaryFew } from '../generated/auxiliary-shaders.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
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
    const { contributions = noContributions(this.#device) } = this.#outputs;
    this.#frame = { ...(painted as PaintedTiles & AuxiliaryFrame), survivors: this.#survivors };
    return new BoundImages().bind(kernel, painted, { survivors: this.#survivors, contributions });
  }
}

/** Placeholder for contributions that the caller did not request. */
const noContributions = (device: GPUDevice): GPUBuffer =>
  perDevice(device, 'no contributions', () =>
    device.createBuffer({ label: 'gs.no_contributions', size: 4, usage: BUFFER_USAGE.storage }),
  );
