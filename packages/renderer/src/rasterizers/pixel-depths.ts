/** How the depth of each visible splat changes from pixel to pixel: see shaders/pixel_depths.wgsl. */
import type { FrameBindings } from '../bindings.js';
import { pixelDepths, pixelDepthsQuantized } from '../generated/order-shaders.js';
import { constants, layouts } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Overrides, type ShaderDescription } from '../gpu/kernel.js';
import type { Scratch } from '../scratch.js';

/** Shader of `pixel_depths`, for any kind of geometry. */
type DepthsShader = ShaderDescription & Pick<typeof pixelDepths, 'bindings'>;

interface Recorded {
  readonly kernel: ComputeKernel<DepthsShader>;
  readonly group: GPUBindGroup;
  readonly groups: number;
}

/** The stage `pixel_depths` of all blocks of a frame. */
export class PixelDepths {
  readonly #device: GPUDevice;
  readonly #overrides: Overrides;
  /** Kernels and bind groups for the blocks of a frame. */
  readonly #blocks = new WeakMap<FrameBindings, readonly Recorded[]>();

  /** @param setsKeys Whether the stage replaces the sort keys. */
  constructor(device: GPUDevice, setsKeys: boolean) {
    this.#device = device;
    this.#overrides = setsKeys ? {} : { sets_keys: 0 };
  }

  /** Returns the buffer array<PixelDepth>, by slot. */
  in(scratch: Scratch): GPUBuffer {
    return scratch.kept('pixel_depths', layouts.PixelDepth.size);
  }

  /** Records the stage: call this after `project` and before the sort. */
  record(pass: GPUComputePassEncoder, bindings: FrameBindings): void {
    let blocks = this.#blocks.get(bindings);
    if (blocks === undefined) this.#blocks.set(bindings, (blocks = this.#bind(bindings)));
    for (const { kernel, group, groups } of blocks) kernel.dispatch(pass, group, groups);
  }

  #bind({ table, scratch }: FrameBindings): Recorded[] {
    const { order, plan, cullStats, keys } = scratch;
    return table.blocks.map((block, i) => {
      const plain = block.reading ? pixelDepthsQuantized : pixelDepths;
      const kernel = kernelOf<DepthsShader>(this.#device, table.readingOf(i)?.pixelDepths ?? plain, this.#overrides);
      const group = kernel.bind({
        ...table.modifiersOf(i),
        ...{ view: table.view(i), gaussians: block.geometry, survivors: order[0], plan, cull_stats: cullStats },
        ...{ pixel_depths: this.in(scratch), keys: keys[0] },
      });
      return { kernel, group, groups: Math.ceil(Math.min(scratch.capacity, block.count) / constants.PROJECT_GROUP) };
    });
  }
}
