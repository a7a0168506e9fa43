import { multiply, SPLAT_FILTERS, type Camera, type SplatFilter, type Vector3 } from '@gaussian-splat/core';
import type { GaussianBlock, PageRequests } from './gaussian-scene.js';
import type { GeometryReading } from './geometry-reading.js';
import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE, type Resource } from './gpu/kernel.js';
import { BufferOwner, GpuMemory } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import type { ProbedSplat } from './probed-splat.js';
import type { RenderSettings } from './render-settings.js';
import { cullGroups } from './stages/stage.js';
import type { DetailBudget } from './stages/detail-budget.js';
import { cameraValues, MAX_FLOAT32 } from './view.js';
import type { Placement, World } from './world.js';
import { SH_PRECISION } from './pack/words.js';

/** Stride of the uniforms of blocks in bytes: WebGPU's default `minUniformBufferOffsetAlignment`. */
const VIEW_STRIDE = 256;

/** A crop that contains everything. */
const EVERYWHERE = {
  min: [-MAX_FLOAT32, -MAX_FLOAT32, -MAX_FLOAT32],
  max: [MAX_FLOAT32, MAX_FLOAT32, MAX_FLOAT32],
} as const;

/** Optical depth of an opaque surface: trainers stop blending at a transmittance of 1e-4. */
const OPAQUE_DEPTH = -Math.log(1e-4);

/** Returns the factor of optical depths that gives an opaque surface the specified opacity, 0..1, as in CSS. */
export const opticalFactor = (opacity: number): number => Math.min(1, -Math.log(1 - opacity) / OPAQUE_DEPTH);

/** The blocks of the visible scenes of a world, with a `View` uniform for each. */
export class BlockTable extends BufferOwner {
  #blocks: readonly GaussianBlock[] = [];
  #firstGroups: Uint32Array = new Uint32Array(1);
  readonly #device: GPUDevice;
  #uniforms!: GPUBuffer;
  #uniformBytes = new ArrayBuffer(0);
  readonly world: World;
  #layout = -1;
  #placements: readonly Placement[] = [];
  /** Placement of each block. */
  #placementOf: readonly Placement[] = [];

  constructor(device: GPUDevice, world: World) {
    super(new GpuMemory(device));
    this.#device = device;
    this.world = world;
    this.lay();
  }

  /**
   * Lays out the blocks of the visible scenes. All bindings to blocks must be recreated; memory is reused if it is
   * large enough.
   */
  lay(): void {
    const { layout, placements } = this.world;
    this.#layout = layout;
    this.#placements = placements.filter(({ visible }) => visible);
    this.#blocks = this.#placements.flatMap(({ scene }) => scene.blocks);
    this.#placementOf = this.#placements.flatMap((placement) => placement.scene.blocks.map(() => placement));
    this.#firstGroups = firstGroups(this.#blocks);
    const bytes = VIEW_STRIDE * Math.max(1, this.#blocks.length);
    if (bytes <= this.#uniformBytes.byteLength) return;
    this.memory.destroy();
    this.#uniformBytes = new ArrayBuffer(bytes);
    const { uniform, copyDestination } = BUFFER_USAGE;
    this.#uniforms = this.memory.buffer('gs.views', bytes, uniform | copyDestination);
  }

  get blocks(): readonly GaussianBlock[] {
    return this.#blocks;
  }

  /** First group (chunk) of each block, followed by the total number of groups. */
  get firstGroups(): Uint32Array {
    return this.#firstGroups;
  }

  /** Number of groups over all blocks. */
  get groups(): number {
    return this.firstGroups[this.blocks.length];
  }

  /** Returns the page requests of the scene of a block; undefined if the scene is not streamed. */
  requestsOf(page: number): PageRequests | undefined {
    return this.#placementOf[page].scene.pageRequests;
  }

  /**
   * Returns the resources that the shaders of a modified block need in addition; empty for a block without a modifier.
   */
  modifiersOf(page: number): Readonly<Record<string, Resource>> {
    const { modifier, scene } = this.#placementOf[page];
    return modifier?.resourcesOf(this.#blocks[page], scene) ?? {};
  }

  /** Returns the shaders that read a block; undefined for the default shaders, which read `PackedGaussian`. */
  readingOf(page: number): GeometryReading | undefined {
    const { reading } = this.blocks[page];
    return this.#placementOf[page].modifier?.reading(reading) ?? reading;
  }

  /**
   * Finds the scene of a splat, and the index of the splat in its scene.
   * @param stored Index of the splat among the padded splats of all blocks.
   */
  splatAt(stored: number): ProbedSplat {
    const group = Math.floor(stored / constants.CULL_GROUP);
    const page = this.#firstGroups.findIndex((first, i) => first <= group && group < (this.#firstGroups[i + 1] ?? 0));
    const placement = this.#placementOf[page];
    if (this.#blocks[page].details) return { placement, index: null };
    const own = this.#placementOf.indexOf(placement);
    const before = this.#blocks.slice(own, page).reduce((sum, { count }) => sum + count, 0);
    return { placement, index: before + stored - constants.CULL_GROUP * this.#firstGroups[page] };
  }

  /** Whether a scene of the table is streamed. */
  get isStreamed(): boolean {
    return this.#placements.some(({ scene }) => scene.pageRequests !== undefined);
  }

  /** Calls `update` of each scene: streamed scenes then upload the received pages. */
  update(): void {
    for (const { scene } of this.#placements) scene.update?.();
  }

  /** Stages that keep frames within a splat budget; undefined without levels of detail. */
  get detailBudget(): DetailBudget | undefined {
    return this.#placements.find(({ scene }) => scene.detailBudget)?.scene.detailBudget;
  }

  /** Whether a block has levels of detail. */
  get hasDetail(): boolean {
    return this.blocks.some(({ details }) => details !== undefined);
  }

  /** Number of splats of all blocks. */
  get splats(): number {
    return this.blocks.reduce((sum, { count }) => sum + count, 0);
  }

  /** Returns the binding of the `View` uniform of a block. */
  view(page: number): GPUBufferBinding {
    return { buffer: this.#uniforms, offset: VIEW_STRIDE * page, size: layouts.View.size };
  }

  /** Whether the table still matches the visible scenes of the world; if not, call {@link lay}. */
  get isCurrent(): boolean {
    return this.#layout === this.world.layout;
  }

  /**
   * Writes the camera uniforms of all blocks, for subsequent submissions.
   * @param pixelArea Area of a pixel of the displayed frame, in pixels of the camera.
   * @param filter Low-pass filter that overrides those of the scenes.
   * @param maxCovered `View.max_covered`; undefined for no limit.
   */
  look(
    camera: Camera,
    pixelArea: number,
    { shDegree, depthKeyBits, order, detail, detailFade, splatBudget }: RenderSettings,
    filter?: SplatFilter,
    maxCovered?: number,
  ): void {
    const shared = {
      sh_cap: shDegree,
      // See shaders/shared/view.wgsl.
      key_bits: order === 'distance' ? 33 : depthKeyBits,
      detail,
      detail_fade: detailFade,
      splat_budget: splatBudget,
      ...(maxCovered !== undefined && { max_covered: maxCovered }),
    };
    let page = 0;
    for (const { scene, sceneToWorld, opacity, crop = EVERYWHERE } of this.#placements) {
      const seen = sceneToWorld ? { ...camera, worldToCamera: multiply(camera.worldToCamera, sceneToWorld) } : camera;
      // Lower resolutions scale the variance in px², so that the filter keeps its size in the displayed frame.
      const { antialiased, filterVariance = constants.DILATION } = filter ? SPLAT_FILTERS[filter] : scene;
      const values = cameraValues(seen, scene.origin, filterVariance * pixelArea);
      const own = {
        opacity: opticalFactor(opacity),
        crop_low: relative(crop.min, scene.origin),
        crop_high: relative(crop.max, scene.origin),
        sh_degree: scene.shDegree,
        sh_encoding: SH_PRECISION[scene.shPrecision],
        antialiased: antialiased ? 1 : 0,
      };
      for (const { count, details } of scene.blocks) {
        const place = { has_detail: details ? 1 : 0, splat_count: count, page, first_group: this.firstGroups[page] };
        const all = { ...values, ...shared, ...own, ...place };
        writeStruct(layouts.View, all, this.#uniformBytes, VIEW_STRIDE * page);
        page++;
      }
    }
    const bytes = VIEW_STRIDE * Math.max(1, this.#blocks.length);
    this.#device.queue.writeBuffer(this.#uniforms, 0, this.#uniformBytes, 0, bytes);
  }
}

/** Returns a corner of a crop relative to the origin of a scene. Infinite coordinates become the largest float32. */
const relative = (corner: Vector3, origin: Vector3): number[] =>
  corner.map((value, axis) => Math.min(MAX_FLOAT32, Math.max(-MAX_FLOAT32, value - origin[axis])));

function firstGroups(blocks: readonly GaussianBlock[]): Uint32Array {
  const first = new Uint32Array(blocks.length + 1);
  blocks.forEach(({ count }, i) => (first[i + 1] = first[i] + cullGroups(count)));
  return first;
}
