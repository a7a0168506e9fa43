import { SPLAT_FILTERS, type Camera, type SplatFilter } from '@gaussian-splat/core';
import type { GaussianPage, GaussianScene, Wishes } from './gaussian-scene.js';
import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import type { Levers } from './levers.js';
import { SH_PRECISION } from './pack/sh.js';
import { cullGroups } from './stages/cull.js';
import { cameraValues } from './view.js';

/** Bytes between the uniforms of two pages: WebGPU's default `minUniformBufferOffsetAlignment`. */
const VIEW_STRIDE = 256;

/** The pages that are drawn together, with a `View` uniform for each. */
export class PageTable {
  readonly pages: readonly GaussianPage[];
  /** First group (chunk) of each page, and behind the last the number of all groups. */
  readonly firstGroups: Uint32Array;
  readonly #device: GPUDevice;
  readonly #memory: GpuMemory;
  readonly #uniforms: GPUBuffer;
  readonly #uniformBytes: ArrayBuffer;
  readonly #scenes: readonly GaussianScene[];

  constructor(device: GPUDevice, scenes: readonly GaussianScene[]) {
    this.#device = device;
    this.#scenes = scenes;
    this.#memory = new GpuMemory(device);
    this.pages = scenes.flatMap((scene) => scene.pages);
    this.firstGroups = firstGroups(this.pages);
    this.#uniformBytes = new ArrayBuffer(VIEW_STRIDE * Math.max(1, this.pages.length));
    const { uniform, copyDestination } = BUFFER_USAGE;
    this.#uniforms = this.#memory.buffer('gs.views', this.#uniformBytes.byteLength, uniform | copyDestination);
  }

  /** Groups of all pages. */
  get groups(): number {
    return this.firstGroups[this.pages.length];
  }

  /** Where views of the scene that a page is part of say what they wish for, if it is streamed. */
  wishesOf(page: number): Wishes | undefined {
    return this.#scenes.find(({ pages }) => pages.includes(this.pages[page]))?.wishes;
  }

  /** True if a scene is streamed. */
  get isStreamed(): boolean {
    return this.#scenes.some(({ wishes }) => wishes !== undefined);
  }

  /** Lets streamed scenes take in what has come. */
  update(): void {
    for (const scene of this.#scenes) scene.update?.();
  }

  /** True if a page has levels of detail. */
  get hasDetail(): boolean {
    return this.pages.some(({ details }) => details !== undefined);
  }

  /** Splats of all pages. */
  get splats(): number {
    return this.pages.reduce((sum, { count }) => sum + count, 0);
  }

  get byteLength(): number {
    return this.#memory.byteLength;
  }

  /** The `View` of a page. */
  view(page: number): GPUBufferBinding {
    return { buffer: this.#uniforms, offset: VIEW_STRIDE * page, size: layouts.View.size };
  }

  /** True if the table was made for exactly these scenes. */
  holds(scenes: readonly GaussianScene[]): boolean {
    return scenes.length === this.#scenes.length && scenes.every((scene, i) => scene === this.#scenes[i]);
  }

  /**
   * Points every page at a camera, for the commands that are submitted next.
   * @param pixelArea area of a pixel of the frame that is shown, in pixels of the camera
   * @param filter in place of those of the scenes
   */
  look(
    camera: Camera,
    pixelArea: number,
    { shDegree, depthKeyBits, detail, detailFade, splatBudget }: Levers,
    filter?: SplatFilter,
  ): void {
    const shared = {
      sh_cap: shDegree,
      key_bits: depthKeyBits,
      detail,
      detail_fade: detailFade,
      splat_budget: splatBudget,
    };
    let page = 0;
    for (const scene of this.#scenes) {
      // The same filter whatever the frame is drawn at: in larger pixels it has less variance.
      const { antialiased, filterVariance = constants.DILATION } = filter ? SPLAT_FILTERS[filter] : scene;
      const values = cameraValues(camera, scene.origin, filterVariance * pixelArea);
      const own = {
        sh_degree: scene.shDegree,
        sh_encoding: SH_PRECISION[scene.shPrecision],
        antialiased: antialiased ? 1 : 0,
      };
      for (const { count, details } of scene.pages) {
        const place = { has_detail: details ? 1 : 0, splat_count: count, page, first_group: this.firstGroups[page] };
        const all = { ...values, ...shared, ...own, ...place };
        writeStruct(layouts.View, all, this.#uniformBytes, VIEW_STRIDE * page);
        page++;
      }
    }
    this.#device.queue.writeBuffer(this.#uniforms, 0, this.#uniformBytes);
  }

  destroy(): void {
    this.#memory.destroy();
  }
}

function firstGroups(pages: readonly GaussianPage[]): Uint32Array {
  const first = new Uint32Array(pages.length + 1);
  pages.forEach(({ count }, i) => (first[i + 1] = first[i] + cullGroups(count)));
  return first;
}
