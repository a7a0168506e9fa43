import { inverse, multiply, type Camera } from '@gaussian-splat/core';
import { angleBetween, axisOf } from './depth-order.js';
import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import { writeStruct, type StructValues } from './gpu/struct.js';
import { OcclusionDepthsStage } from './stages/occlusion-depths.js';

const { TILE, OCCLUSION_BLOCK } = constants;
/** Image sizes up to this one share buffers. */
const USUAL = [4096, 2304] as const;
/** Radians of a turn after which the last frame has nothing to say. */
const JUMP = 0.5;
type OcclusionViewValues = StructValues<typeof layouts.OcclusionView>;
const NONE = [0, 0] as const;

/** How many tiles, across and down. */
type Tiles = readonly [columns: number, rows: number];

/**
 * Occlusion culling by the last frame. Tiles note the depth at which their last pixel was finished, traced to where they are in the
 * next frame; a splat behind the depths of all its tiles is not drawn. A tile that turns out not to be finished
 * by the depth it was given lacks splats in that frame, and is complete in the next one.
 */
export class Occlusion {
  readonly #device: GPUDevice;
  #isUsed: boolean;
  readonly #memory: GpuMemory;
  readonly #stage: OcclusionDepthsStage;
  readonly #view: GPUBuffer;
  readonly #viewBytes = new ArrayBuffer(layouts.OcclusionView.size);
  #words = 0;
  #depths: GPUBuffer;
  #lastDepths: GPUBuffer;
  #bindings: GPUBindGroup;
  #tiles: Tiles = NONE;
  #last: { readonly camera: Camera; readonly version: number } | undefined;
  #mayLack = false;
  /** Whether the frame at hand leaves anything out. */
  #isOn = false;

  /** @param isUsed false where nothing tells how far one sees; then all is as if every tile were open. See {@link use} */
  constructor(device: GPUDevice, isUsed: boolean) {
    this.#device = device;
    this.#isUsed = isUsed;
    this.#memory = new GpuMemory(device);
    this.#stage = new OcclusionDepthsStage(device);
    if (isUsed) this.#stage.prepare();
    const { uniform, copyDestination } = BUFFER_USAGE;
    this.#view = this.#memory.buffer('gs.occlusion.view', layouts.OcclusionView.size, uniform | copyDestination);
    this.#words = isUsed ? wordsOf(tilesOf(...USUAL)) : 1;
    [this.#depths, this.#lastDepths, this.#bindings] = this.#allocate();
  }

  /** How far one sees: see shaders/shared/occlusion.wgsl. */
  get depths(): GPUBuffer {
    return this.#depths;
  }

  /** How far one saw in each tile: what the rasterizer writes. */
  get lastDepths(): GPUBuffer {
    return this.#lastDepths;
  }

  /** Tiles for which the frame at hand has depths; 0 if it is drawn without. */
  get tiles(): Tiles {
    return this.#tiles;
  }

  /** True if the frame at hand may lack splats that the next one will have: one drawn while the camera moved. */
  get mayLack(): boolean {
    return this.#mayLack;
  }

  get byteLength(): number {
    return this.#memory.byteLength;
  }

  /** Frames to come may leave out what is hidden. */
  use(): void {
    this.#isUsed = true;
    this.#stage.prepare();
  }

  /** Sees to room for an image. @returns true if the buffers are other ones now */
  fit({ width, height }: Camera): boolean {
    const words = wordsOf(tilesOf(width, height));
    if (!this.#isUsed || words <= this.#words) return false;
    this.#words = Math.max(words, wordsOf(tilesOf(...USUAL)));
    this.#memory.free(this.#depths);
    this.#memory.free(this.#lastDepths);
    [this.#depths, this.#lastDepths, this.#bindings] = this.#allocate();
    this.forget();
    return true;
  }

  /** Forgets the last frame: what follows shows other splats. */
  forget(): void {
    this.#last = undefined;
  }

  /**
   * Prepares a frame; {@link record} must follow.
   * @param version of the content
   * @param isOn false for a frame that leaves nothing out
   */
  prepare(encoder: GPUCommandEncoder, camera: Camera, version: number, isOn: boolean): void {
    this.#isOn = this.#isUsed && isOn;
    if (!this.#isOn) return this.#pass();
    const last = this.#last;
    const isKnown = last !== undefined && last.version === version && isNear(last.camera, camera);
    this.#tiles = tilesOf(camera.width, camera.height);
    this.#mayLack = isKnown && !isSame(last.camera, camera);
    this.#last = { camera, version };
    writeStruct(
      layouts.OcclusionView,
      occlusionView(camera, last?.camera ?? camera, this.#tiles, isKnown),
      this.#viewBytes,
    );
    this.#device.queue.writeBuffer(this.#view, 0, this.#viewBytes);
    encoder.clearBuffer(this.#depths);
  }

  record(pass: GPUComputePassEncoder): void {
    if (this.#isOn) this.#stage.record(pass, this.#bindings, this.#tiles);
  }

  destroy(): void {
    this.#memory.destroy();
  }

  /** What such a frame sees is not noted. */
  #pass(): void {
    this.#tiles = NONE;
    this.#mayLack = false;
    this.#last = undefined;
  }

  #allocate(): [depths: GPUBuffer, lastDepths: GPUBuffer, bindings: GPUBindGroup] {
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination;
    const depths = this.#memory.buffer('gs.occlusion.depths', 4 * this.#words, usage);
    const lastDepths = this.#memory.buffer('gs.occlusion.last_depths', 4 * this.#words, usage);
    return [depths, lastDepths, this.#stage.bind({ view: this.#view, last_depths: lastDepths, depths })];
  }
}

const tilesOf = (width: number, height: number): Tiles => [Math.ceil(width / TILE), Math.ceil(height / TILE)];

const wordsOf = ([columns, rows]: Tiles): number =>
  columns * rows + Math.ceil(columns / OCCLUSION_BLOCK) * Math.ceil(rows / OCCLUSION_BLOCK);

const lensOf = ({ width, height, fx, fy, cx, cy, near, far }: Camera): number[] => [
  width,
  height,
  fx,
  fy,
  cx,
  cy,
  near,
  far,
];

function isNear(a: Camera, b: Camera): boolean {
  const clips = a.near === b.near && a.far === b.far;
  return clips && a.width === b.width && a.height === b.height && angleBetween(axisOf(a), axisOf(b)) < JUMP;
}

const isSame = (a: Camera, b: Camera): boolean =>
  [...lensOf(a), ...a.worldToCamera].every((value, i) => value === [...lensOf(b), ...b.worldToCamera][i]);

/** What `occlusion_depths` must know of this camera and the last one. */
export function occlusionView(camera: Camera, last: Camera, tiles: Tiles, isKnown: boolean): OcclusionViewValues {
  const between = (from: Camera, to: Camera): number[] =>
    columnsOf(multiply(to.worldToCamera, inverse(from.worldToCamera)));
  return {
    to_last: between(camera, last),
    from_last: between(last, camera),
    focal: [camera.fx, camera.fy],
    principal: [camera.cx, camera.cy],
    last_focal: [last.fx, last.fy],
    last_principal: [last.cx, last.cy],
    viewport: [camera.width, camera.height],
    tiles,
    is_known: isKnown ? 1 : 0,
  };
}

const columnsOf = (rows: ArrayLike<number>): number[] =>
  Array.from({ length: 16 }, (_, i) => rows[4 * (i % 4) + Math.floor(i / 4)]);
