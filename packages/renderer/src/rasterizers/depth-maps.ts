/** Depth and identity of each pixel. Few pages use them, so their code is loaded with the first such frame. */
import type { FrameBindings } from '../bindings.js';
import { recordProjection, type Frame } from '../frame.js';
import type { PageRequests } from '../gaussian-scene.js';
import { rasterizeTilesMaps, splatOwners } from '../generated/maps-shaders.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, kernelOf } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import type { Scratch } from '../scratch.js';
import type { Placement } from '../world.js';
import { PixelDepths } from './pixel-depths.js';
import type { AuxiliaryOutputs, AuxiliaryTilePainter } from './rasterizer.js';
import { rasterizeKernel, type PaintedTiles, type RasterizeKernel } from './tile-kernels.js';
import { BoundImages } from './tile-painter.js';

/** Auxiliary outputs that write depth and identity. A frame needs both members: `{ auxiliary: maps, project: maps.project }`. */
export class DepthMaps implements AuxiliaryOutputs {
  /** Placements by their ids, which begin with 1. */
  owners: readonly Placement[] = [];
  readonly #device: GPUDevice;
  readonly #maps: GPUTexture;
  readonly #depths: PixelDepths;
  readonly #memory: GpuMemory;
  #scratch: Scratch | undefined;
  #isParallel = false;

  /** @param maps Receives expected depth, median depth, coverage and id. Format `rgba32float`, usage STORAGE_BINDING. */
  constructor(device: GPUDevice, maps: GPUTexture) {
    this.#device = device;
    this.#maps = maps;
    this.#depths = new PixelDepths(device, false);
    this.#memory = new GpuMemory(device);
  }

  /** Records the stages before the rasterizer, with those that find depths and owners. */
  readonly project = (encoder: GPUCommandEncoder, frame: Frame): PageRequests[] => {
    this.#scratch = frame.scratch;
    this.#isParallel = frame.camera.orthographic === true;
    const recordDepths = (pass: GPUComputePassEncoder, bindings: FrameBindings): void => {
      this.#depths.record(pass, bindings);
      this.#recordOwners(pass, bindings);
    };
    return recordProjection(encoder, { ...frame, order: { recordDepths } });
  };

  painter(): AuxiliaryTilePainter {
    return {
      tile: constants.TILE,
      frame: undefined,
      kernel: (variant) =>
        rasterizeKernel(this.#device, rasterizeTilesMaps, variant, { is_parallel: +this.#isParallel }),
      bind: (kernel, painted) => this.#bind(kernel, painted),
    };
  }

  /** Frees the memory. The texture belongs to the caller. */
  destroy(): void {
    this.#memory.destroy();
  }

  #bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup {
    const scratch = this.#scratch!;
    return new BoundImages().bind(kernel, painted, {
      pixel_depths: this.#depths.in(scratch),
      owners: scratch.kept('owners'),
      maps: this.#maps.createView(),
    });
  }

  #recordOwners(pass: GPUComputePassEncoder, { table, scratch }: FrameBindings): void {
    const { order, plan, capacity } = scratch;
    const kernel = kernelOf(this.#device, splatOwners);
    // The buffers of an earlier attempt at the same image.
    this.#memory.destroy();
    const placements = table.blocks.map(
      (_, i) => table.splatAt(constants.CULL_GROUP * table.firstGroups[i]).placement!,
    );
    this.owners = [...new Set(placements)];
    table.blocks.forEach(({ count }, i) => {
      const id = Uint32Array.of(1 + this.owners.indexOf(placements[i]));
      const ids = this.#memory.buffer('gs.splat_owners.ids', 4, BUFFER_USAGE.storage, id);
      const group = kernel.bind({
        ...{ view: table.view(i), survivors: order[0], plan, owners: scratch.kept('owners') },
        ids: { buffer: ids, size: 4 },
      });
      kernel.dispatch(pass, group, Math.ceil(Math.min(capacity, count) / constants.PROJECT_GROUP));
    });
  }
}
