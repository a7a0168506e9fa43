import type { Camera } from '@gaussian-splat/core';
import type { GaussianBuffers, GaussianPage } from './gaussian-buffers.js';
import { layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import type { Scratch } from './scratch.js';
import { CompactStage } from './stages/compact.js';
import { cullGroups, CullStage } from './stages/cull.js';
import { ProjectStage } from './stages/project.js';
import { cameraValues } from './view.js';

/** A page as one frame draws it. */
export interface FramePage {
  readonly page: GaussianPage;
  readonly cull: GPUBindGroup;
  readonly compact: GPUBindGroup;
  readonly project: GPUBindGroup;
}

/** Bytes between the uniforms of two pages: WebGPU's default `minUniformBufferOffsetAlignment`. */
const VIEW_STRIDE = 256;

/** The pages that are drawn together, with a `View` uniform and bind groups for each. */
export class PageTable {
  readonly pages: readonly FramePage[];
  readonly #device: GPUDevice;
  readonly #memory: GpuMemory;
  readonly #uniforms: GPUBuffer;
  readonly #uniformBytes: ArrayBuffer;
  readonly #scenes: readonly GaussianBuffers[];
  readonly #keyBits: number;

  constructor(device: GPUDevice, scenes: readonly GaussianBuffers[], scratch: Scratch, keyBits: number) {
    this.#keyBits = keyBits;
    this.#device = device;
    this.#scenes = scenes;
    this.#memory = new GpuMemory(device);
    const pages = scenes.flatMap((scene) => scene.pages);
    this.#uniformBytes = new ArrayBuffer(VIEW_STRIDE * Math.max(1, pages.length));
    const { uniform, copyDestination } = BUFFER_USAGE;
    this.#uniforms = this.#memory.buffer('gs.views', this.#uniformBytes.byteLength, uniform | copyDestination);
    this.pages = bindPages(device, pages, this.#uniforms, scratch);
    device.queue.writeBuffer(scratch.pageGroups, 0, firstGroups(pages));
  }

  get byteLength(): number {
    return this.#memory.byteLength;
  }

  /** True if the table was made for exactly these scenes. */
  holds(scenes: readonly GaussianBuffers[]): boolean {
    return scenes.length === this.#scenes.length && scenes.every((scene, i) => scene === this.#scenes[i]);
  }

  /** Points every page at a camera, for the commands that are submitted next. */
  look(camera: Camera): void {
    let page = 0;
    let firstGroup = 0;
    for (const scene of this.#scenes) {
      const values = cameraValues(camera, scene.origin);
      for (const { count } of scene.pages) {
        const perPage = { splat_count: count, page, first_group: firstGroup, sh_degree: scene.shDegree };
        const view = { ...values, ...perPage, antialiased: scene.antialiased ? 1 : 0, key_bits: this.#keyBits };
        writeStruct(layouts.View, view, this.#uniformBytes, VIEW_STRIDE * page);
        firstGroup += cullGroups(count);
        page++;
      }
    }
    this.#device.queue.writeBuffer(this.#uniforms, 0, this.#uniformBytes);
  }

  destroy(): void {
    this.#memory.destroy();
  }
}

/** First cull group of each page, and behind the last the number of all groups. */
function firstGroups(pages: readonly GaussianPage[]): Uint32Array<ArrayBuffer> {
  const first = new Uint32Array(pages.length + 1);
  pages.forEach(({ count }, i) => (first[i + 1] = first[i] + cullGroups(count)));
  return first;
}

function bindPages(
  device: GPUDevice,
  pages: readonly GaussianPage[],
  uniforms: GPUBuffer,
  { visibleBits, groupOffsets, plan, splats, keys, order }: Scratch,
): FramePage[] {
  const [cull, compact, project] = [new CullStage(device), new CompactStage(device), new ProjectStage(device)];
  // The sort needs its first order buffer only after `project` has read the survivors from it.
  const survivors = order[0];
  return pages.map((page, i) => {
    const view = { buffer: uniforms, offset: VIEW_STRIDE * i, size: layouts.View.size };
    const gaussians = page.geometry;
    return {
      page,
      cull: cull.bind({ view, gaussians, visible_bits: visibleBits, group_counts: groupOffsets, plan }),
      compact: compact.bind({ view, visible_bits: visibleBits, group_offsets: groupOffsets, survivors }),
      project: project.bind({ view, gaussians, sh: page.sh, survivors, plan, splats, keys: keys[0] }),
    };
  });
}
