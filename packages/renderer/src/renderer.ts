import { GaussianSplatError, validateCamera, type Camera } from '@gaussian-splat/core';
import { AccumulationTexture } from './accumulation.js';
import { recordFrame, type Stages } from './frame.js';
import type { GaussianBuffers } from './gaussian-buffers.js';
import { layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import type { PassTimer } from './gpu/pass-timer.js';
import { GpuMemory } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import { PageTable } from './page-table.js';
import { QuadsRasterizer } from './rasterizers/quads.js';
import { TilesRasterizer } from './rasterizers/tiles.js';
import type { AccumulationFormat, Rasterizer, RasterizerName } from './rasterizers/rasterizer.js';
import { Scratch } from './scratch.js';
import { CompactStage } from './stages/compact.js';
import { ComposeStage } from './stages/compose.js';
import { cullGroups, CullStage } from './stages/cull.js';
import { PlanStage } from './stages/plan.js';
import { ProjectStage } from './stages/project.js';
import { ScanStage } from './stages/scan.js';
import { sortedIn, SortStage, type SortBindings } from './stages/sort.js';
import { readStatistics, type FrameStatistics } from './statistics.js';

export interface RendererOptions {
  /**
   * How splats become pixels: `quads` by the GPU's own rasterizer and blending, `tiles` by compute shaders, front to back
   * in float32 and with an end where nothing behind can be seen. Default `auto`, which today is always `quads`.
   */
  readonly rasterizer?: 'auto' | RasterizerName;
  /**
   * Precision in which splats are blended. Default `rgba16float`. `rgba32float` takes twice the memory and bandwidth
   * and needs the feature `float32-blendable`.
   */
  readonly accumulation?: AccumulationFormat;
  /**
   * Bits of the keys that splats are sorted by. 32 are those of the float32 depth and sort exactly; fewer are spread over
   * the logarithm of the visible depths. Default 24, which no image was seen to tell from 32; 16 cost
   * up to 13 dB on captured scenes (down to 58.9 dB).
   */
  readonly depthKeyBits?: 16 | 24 | 32;
}

/** One image to draw. */
export interface FrameRequest {
  /** One scene, or several that are sorted and blended together. Order decides between equal depths. */
  readonly gaussians: GaussianBuffers | readonly GaussianBuffers[];
  /** Its width and height must be those of the target. */
  readonly camera: Camera;
  readonly target: GPUTextureView;
  /** Format of the target: any colour format that WebGPU can render to. */
  readonly targetFormat: GPUTextureFormat;
  /** Premultiplied red, green, blue and alpha behind the splats. Default: transparent. */
  readonly background?: readonly [red: number, green: number, blue: number, alpha: number];
  /** Notes when each pass ran. */
  readonly timer?: PassTimer;
}

/** What a set of scenes needs on the GPU between the stages. */
interface Resources {
  readonly scratch: Scratch;
  readonly table: PageTable;
  readonly scan: GPUBindGroup;
  readonly makePlan: GPUBindGroup;
  readonly sort: SortBindings;
}

/** What an image size needs. */
interface Surface {
  readonly accumulation: AccumulationTexture;
  readonly compose: GPUBindGroup;
}

const TRANSPARENT = [0, 0, 0, 0] as const;
const DEFAULT_KEY_BITS = 24;

/**
 * Draws Gaussians into a texture view, on a device of yours.
 *
 * ```ts
 * const renderer = new Renderer(device);
 * const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
 * renderer.render({ gaussians, camera, target: texture.createView(), targetFormat: texture.format });
 * ```
 *
 * Memory is allocated when the scenes or the image size change, never while only the camera moves; nothing is read back.
 */
export class Renderer {
  readonly #device: GPUDevice;
  readonly #format: AccumulationFormat;
  readonly #keyBits: number;
  readonly #stages: Stages;
  readonly #rasterizer: Rasterizer;
  readonly #memory: GpuMemory;
  readonly #uniforms: { readonly scan: GPUBuffer; readonly limits: GPUBuffer; readonly compose: GPUBuffer };
  readonly #composeBytes = new ArrayBuffer(layouts.Compose.size);
  #resources: Resources | undefined;
  #surface: Surface | undefined;

  /** @throws GaussianSplatError `unsupported/limits` if an option needs a feature that the device lacks. */
  constructor(device: GPUDevice, options: RendererOptions = {}) {
    this.#device = device;
    this.#format = options.accumulation ?? 'rgba16float';
    this.#keyBits = options.depthKeyBits ?? DEFAULT_KEY_BITS;
    this.#stages = {
      cull: new CullStage(device),
      scan: new ScanStage(device),
      plan: new PlanStage(device),
      compact: new CompactStage(device),
      project: new ProjectStage(device),
      sort: new SortStage(device),
      compose: new ComposeStage(device),
    };
    this.#rasterizer = makeRasterizer(device, options.rasterizer ?? 'auto', this.#format);
    this.#memory = new GpuMemory(device);
    const uniform = (name: string): GPUBuffer =>
      this.#memory.buffer(`gs.${name}`, 16, BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination);
    this.#uniforms = {
      scan: uniform('scan.uniform'),
      limits: uniform('plan.limits'),
      compose: uniform('compose.uniform'),
    };
  }

  /** Name of the rasterizer in use. */
  get rasterizer(): RasterizerName {
    return this.#rasterizer.name;
  }

  /** Bytes of GPU memory held between frames, scenes not counted. */
  get byteLength(): number {
    const { scratch, table } = this.#resources ?? {};
    const parts = [this.#memory, scratch, table, this.#rasterizer, this.#surface?.accumulation];
    return parts.reduce((sum, part) => sum + (part?.byteLength ?? 0), 0);
  }

  /**
   * Encodes and submits one frame.
   * @throws GaussianSplatError `argument/camera` for a camera out of range; `out-of-memory/buffer-limit` if the scenes
   * need a larger buffer than the device allows.
   */
  render(request: FrameRequest): void {
    const { camera, target, targetFormat, background = TRANSPARENT, timer } = request;
    validateCamera(camera);
    requireTextureSize(this.#device, camera);
    const scenes = Array.isArray(request.gaussians) ? request.gaussians : [request.gaussians as GaussianBuffers];
    const { scratch, table, scan, makePlan, sort } = this.#resourcesFor(scenes);
    const { accumulation, compose } = this.#surfaceOf(camera.width, camera.height);
    table.look(camera);
    writeStruct(layouts.Compose, { background }, this.#composeBytes);
    this.#device.queue.writeBuffer(this.#uniforms.compose, 0, this.#composeBytes);

    const encoder = this.#device.createCommandEncoder({ label: 'gs.frame' });
    recordFrame(encoder, {
      stages: this.#stages,
      pages: table.pages,
      plan: scratch.plan,
      scan,
      makePlan,
      sort,
      rasterizer: this.#rasterizer,
      accumulation,
      compose,
      target,
      targetFormat,
      timer,
    });
    this.#device.queue.submit([encoder.finish()]);
  }

  /** Counts of the last frame. Reads back from the GPU: for tests and panels, not for every frame. */
  async readStatistics(): Promise<FrameStatistics> {
    if (this.#resources === undefined) return { visible: 0, overflow: 0, unusable: 0 };
    return readStatistics(this.#device, this.#resources.scratch.plan);
  }

  /** Frees all GPU memory. Scenes are not touched: they belong to whoever uploaded them. */
  destroy(): void {
    this.#releaseResources();
    this.#surface?.accumulation.destroy();
    this.#surface = undefined;
    this.#rasterizer.destroy();
    this.#memory.destroy();
  }

  #resourcesFor(scenes: readonly GaussianBuffers[]): Resources {
    if (this.#resources?.table.holds(scenes)) return this.#resources;
    this.#releaseResources();
    const pages = scenes.flatMap((scene) => scene.pages);
    const groups = pages.reduce((sum, { count }) => sum + cullGroups(count), 0);
    const splats = pages.reduce((sum, { count }) => sum + count, 0);
    const scratch = new Scratch(this.#device, { splats, groups, pages: pages.length });
    const { groupOffsets, pageGroups, plan, order, splats: projected } = scratch;
    const { scan, limits } = this.#uniforms;
    this.#device.queue.writeBuffer(scan, 0, Uint32Array.of(groups));
    this.#device.queue.writeBuffer(limits, 0, Uint32Array.of(pages.length, scratch.capacity));
    this.#rasterizer.bind({
      plan,
      splats: projected,
      order: order[sortedIn(this.#keyBits)],
      capacity: scratch.capacity,
    });
    this.#resources = {
      scratch,
      table: new PageTable(this.#device, [...scenes], scratch, this.#keyBits),
      scan: this.#stages.scan.bind({ values: groupOffsets, scan }),
      makePlan: this.#stages.plan.bind({ limits, group_offsets: groupOffsets, page_groups: pageGroups, plan }),
      sort: this.#stages.sort.bind(scratch, this.#keyBits),
    };
    return this.#resources;
  }

  #releaseResources(): void {
    this.#resources?.table.destroy();
    this.#resources?.scratch.destroy();
    this.#resources = undefined;
  }

  #surfaceOf(width: number, height: number): Surface {
    const current = this.#surface;
    if (current?.accumulation.width === width && current.accumulation.height === height) return current;
    current?.accumulation.destroy();
    const accumulation = new AccumulationTexture(this.#device, this.#format, width, height);
    const compose = this.#stages.compose.bind({ compose: this.#uniforms.compose, accumulated: accumulation.view });
    this.#surface = { accumulation, compose };
    return this.#surface;
  }
}

function requireTextureSize(device: GPUDevice, { width, height }: Camera): void {
  const limit = device.limits.maxTextureDimension2D;
  if (Math.max(width, height) <= limit) return;
  throw new GaussianSplatError('argument/camera', {
    where: 'camera.width and camera.height',
    expected: `at most ${limit} pixels each (maxTextureDimension2D of the device)`,
    found: `${width}x${height}`,
    remedy: 'draw a smaller image, or several parts of it by moving cx and cy',
  });
}

function makeRasterizer(device: GPUDevice, name: 'auto' | RasterizerName, format: AccumulationFormat): Rasterizer {
  if (name === 'tiles') return new TilesRasterizer(device, format);
  requireBlendable(device, format);
  return new QuadsRasterizer(device, format);
}

function requireBlendable(device: GPUDevice, format: AccumulationFormat): void {
  if (format !== 'rgba32float' || device.features.has('float32-blendable')) return;
  throw new GaussianSplatError('unsupported/limits', {
    where: 'RendererOptions.accumulation',
    expected: 'a device with the feature float32-blendable',
    found: 'a device without it',
    remedy: 'ask for the feature with deviceDescriptor(adapter), or use rgba16float',
  });
}
