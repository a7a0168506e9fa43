import {
  add,
  DEFAULT_FAR,
  GaussianSplatError,
  lookAt,
  scale,
  type Bounds,
  type Camera,
  type Vector3,
} from '@gaussian-splat/core';
import { Renderer, SIDES, SidedGaussians, type HeldScene, type Surroundings } from '@gaussian-splat/renderer';
import {
  BUFFER_USAGE,
  cameraValues,
  GpuMemory,
  layouts as rendererLayouts,
  rareKernelOf,
  TEXTURE_USAGE,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { noteSides, SIDE_GROUP, Side as layout } from './generated/shaders.js';
import { NO_VIEW } from './gpu/layouts.js';
import { PictureErrors } from './gpu/picture-errors.js';
import { readBack } from './gpu/read-back.js';
import { decibelsTogether } from './measure.js';
import { viewsAround } from './views.js';

const { View: viewLayout } = rendererLayouts;

/** Distances from the middle that a side is looked at from, in radii of the scene, and the tangent of half the angle that the square picture shows. */
const LOOKS = [
  { distance: 1.3, tangent: 1.2 },
  { distance: 2.6, tangent: 0.7 },
] as const;
const FARTHEST = LOOKS[LOOKS.length - 1];
/** Alpha times transmittance, in some pixel, from which on a splat shows: measured, see docs/decisions/0017. */
const LEAST_WEIGHT = 0.5 / 255;
/** Smaller scenes have larger splats, which are seen as well in smaller pictures: pixels for each splat, and sides of a picture. */
const PIXELS_OF_SPLAT = 4;
const [LEAST_SIZE, LARGEST_SIZE] = [64, 1024];
/** Rounds in which sides are looked at again whose pictures had no room for all that they should show. */
const MOST_ROUNDS = 4;
/** Pictures between two turns of others. */
const PICTURES_AT_ONCE = 4;
/** Views that a figure is measured in: not those that a scene was looked at from. */
const HELD_OUT = 6;
const HELD_OUT_SEED = 3;
const COUNTS_BYTES = 16;
const CHUNK = 256;
const FLOAT_BYTES = 4;

/** Pixels of the views that a figure is measured in. Fewer splats are larger, and seen as well in smaller ones: so many pixels for each, and at least a quarter of each side. */
export interface ViewSize {
  readonly width: number;
  readonly height: number;
}
const LARGEST_VIEW: ViewSize = { width: 480, height: 270 };
const VIEW_PIXELS_OF_SPLAT = 16;
const LEAST_SCALE = 0.25;

function viewSizeOf(count: number): ViewSize {
  const { width, height } = LARGEST_VIEW;
  const scale = Math.min(1, Math.max(LEAST_SCALE, Math.sqrt((VIEW_PIXELS_OF_SPLAT * count) / (width * height))));
  return { width: Math.round(scale * width), height: Math.round(scale * height) };
}

export interface LookAroundOptions {
  readonly signal?: AbortSignal;
  /** Pixels of each side of the square pictures; default 64 to 1,024, by the number of splats. */
  readonly size?: number;
  /** Bytes of GPU memory that the sets may take; default no limit but the device's. */
  readonly memoryBudget?: number;
}

/**
 * Looks at a scene from 128 sides, twice from each, and notes on the GPU which splats show: the visible sets that the lever `visibleSets` draws from. The page's own
 * frames come between. Nothing of the scene is changed. Takes 16 bytes of GPU memory a splat.
 * @param around the sphere that the scene fills: its `bounds`
 * @returns the scene with its sets, which holds the scene and frees it
 * @throws GaussianSplatError `out-of-memory/*`; the signal's reason; or rejects if the device is lost
 */
export async function lookAround<S extends HeldScene>(
  device: GPUDevice,
  scene: S,
  around: Surroundings,
  { signal, size = sizeOf(scene.count), memoryBudget }: LookAroundOptions = {},
): Promise<SidedGaussians<S>> {
  const sided = await SidedGaussians.of(device, scene, around, memoryBudget);
  const onlooker = new Onlooker(device, sided, size);
  try {
    await onlooker.lookFromAll(signal);
    return sided;
  } catch (error) {
    sided.release();
    throw error;
  } finally {
    onlooker.destroy();
  }
}

/**
 * How far pictures from the visible sets are from those of the whole scene, dB over the pixels that the whole covers, in views around it. Scenes of many subjects far apart
 * hide one thing behind another otherwise from nearby than from farther away: there the figure is low.
 */
export async function visibleSetsDecibels(
  device: GPUDevice,
  sided: SidedGaussians,
  bounds: Bounds,
  { signal, viewSize = viewSizeOf(sided.count) }: { readonly signal?: AbortSignal; readonly viewSize?: ViewSize } = {},
): Promise<number> {
  const pause = async (): Promise<void> => {
    await device.queue.onSubmittedWorkDone();
    signal?.throwIfAborted();
  };
  const renderer = new Renderer(device, { visibleSets: true });
  const views = viewsAround(bounds, HELD_OUT, { ...viewSize, seed: HELD_OUT_SEED });
  try {
    const errors = await PictureErrors.of(device, renderer, sided.whole, views, pause);
    try {
      return decibelsTogether(await errors.measure(sided, pause));
    } finally {
      errors.destroy();
    }
  } finally {
    renderer.destroy();
  }
}

function sizeOf(count: number): number {
  return Math.round(Math.min(LARGEST_SIZE, Math.max(LEAST_SIZE, Math.sqrt(PIXELS_OF_SPLAT * count))));
}

/** Draws a scene from its sides. */
class Onlooker {
  readonly #device: GPUDevice;
  readonly #sided: SidedGaussians;
  readonly #size: number;
  readonly #renderer: Renderer;
  readonly #memory: GpuMemory;
  readonly #target: GPUTexture;
  /** By slot: the largest weight in the pictures at hand. */
  readonly #weights: GPUBuffer;
  /** Of each picture: what tells whether it had room for all. */
  readonly #counts: GPUBuffer;
  /** Bind groups of each page, and what is written before they are used. */
  readonly #pages: readonly {
    readonly count: number;
    readonly view: GPUBuffer;
    readonly side: GPUBuffer;
    readonly bindings: GPUBindGroup;
  }[];

  constructor(device: GPUDevice, sided: SidedGaussians, size: number) {
    this.#device = device;
    this.#sided = sided;
    this.#size = size;
    this.#renderer = new Renderer(device, { rasterizer: 'tiles' });
    this.#memory = new GpuMemory(device);
    const { storage, uniform, copySource, copyDestination } = BUFFER_USAGE;
    const bytes = sided.pages.reduce((sum, { count }) => sum + weightBytes(count), 0);
    this.#weights = this.#memory.buffer('gs.economise.weights', bytes, storage);
    const counts = COUNTS_BYTES * LOOKS.length * SIDES.length;
    this.#counts = this.#memory.buffer('gs.economise.counts', counts, copySource | copyDestination);
    let offset = 0;
    this.#pages = sided.pages.map(({ count, geometry, seenFrom }) => {
      const view = this.#memory.buffer('gs.economise.view', viewLayout.size, uniform | copyDestination);
      const side = this.#memory.buffer('gs.economise.side', layout.size, uniform | copyDestination);
      const weights = { buffer: this.#weights, offset, size: weightBytes(count) };
      offset += weightBytes(count);
      const resources = { view, side, gaussians: geometry, weights, seen_from: seenFrom };
      return { count, view, side, bindings: rareKernelOf(device, noteSides).bind(resources) };
    });
    const usage = TEXTURE_USAGE.renderAttachment;
    this.#target = device.createTexture({ size: [size, size], format: 'rgba16float', usage });
  }

  async lookFromAll(signal: AbortSignal | undefined): Promise<void> {
    let due = SIDES.map((_, side) => side);
    for (let round = 0; round < MOST_ROUNDS && due.length > 0; round++) {
      for (const [k, side] of due.entries()) {
        this.#look(side);
        if ((LOOKS.length * k) % PICTURES_AT_ONCE === 0) await this.#device.queue.onSubmittedWorkDone();
        signal?.throwIfAborted();
      }
      due = await this.#lacking(due);
    }
    await this.#device.queue.onSubmittedWorkDone();
    signal?.throwIfAborted();
    if (due.length > 0) throw lacking(due.length);
  }

  destroy(): void {
    this.#renderer.destroy();
    this.#memory.destroy();
    this.#target.destroy();
  }

  #look(side: number): void {
    LOOKS.forEach((look, k) => {
      const camera = cameraOf(SIDES[side], look, this.#sided.around, this.#size);
      const notes = { contributions: this.#weights };
      this.#renderer.render({ gaussians: this.#sided, camera, target: this.#target, notes });
      this.#note(side, camera, look === FARTHEST);
      const encoder = this.#device.createCommandEncoder({ label: 'gs.economise.counts' });
      this.#renderer.copyCounts(encoder, this.#counts, COUNTS_BYTES * (LOOKS.length * side + k));
      this.#device.queue.submit([encoder.finish()]);
    });
  }

  /** Adds the side to the sets of what the picture that was drawn last shows. */
  #note(side: number, camera: Camera, isWidest: boolean): void {
    const { origin, antialiased, filterVariance } = this.#sided;
    const view = { ...NO_VIEW, ...cameraValues(camera, origin, filterVariance), antialiased: +antialiased };
    const own = { bit: (1 << (side & 31)) >>> 0, word: side >>> 5, least_weight: LEAST_WEIGHT, is_widest: +isWidest };
    const bytes = new ArrayBuffer(Math.max(viewLayout.size, layout.size));
    for (const { count, view: viewBuffer, side: sideBuffer } of this.#pages) {
      writeStruct(viewLayout, { ...view, splat_count: count }, bytes);
      this.#device.queue.writeBuffer(viewBuffer, 0, bytes, 0, viewLayout.size);
      writeStruct(layout, own, bytes);
      this.#device.queue.writeBuffer(sideBuffer, 0, bytes, 0, layout.size);
    }
    const kernel = rareKernelOf(this.#device, noteSides);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.economise.sides' });
    const pass = encoder.beginComputePass({ label: 'gs.economise.sides' });
    for (const { count, bindings } of this.#pages) kernel.dispatch(pass, bindings, Math.ceil(count / SIDE_GROUP));
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
  }

  /** Those of some sides whose pictures had no room for all that they should show; the next ones will. */
  async #lacking(sides: readonly number[]): Promise<number[]> {
    const [counts] = await readBack(this.#device, [{ buffer: this.#counts }]);
    const hadRoom = (side: number): boolean =>
      !LOOKS.map((_, k) => {
        const offset = COUNTS_BYTES * (LOOKS.length * side + k);
        return this.#renderer.hadRoom(new Uint32Array(counts, offset, 4));
      }).includes(false);
    return sides.filter((side) => !hadRoom(side));
  }
}

function lacking(sides: number): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/buffer-limit', {
    where: 'visible sets',
    expected: 'room for all that each picture of the scene shows',
    found: `${sides} of ${SIDES.length} sides whose pictures lacked some of it, after ${MOST_ROUNDS} rounds`,
    remedy: 'make visible sets of a smaller scene',
  });
}

/** Weights of whole chunks, as the renderer counts slots. */
const weightBytes = (count: number): number => FLOAT_BYTES * CHUNK * Math.ceil(count / CHUNK);

function cameraOf(
  direction: Vector3,
  { distance, tangent }: (typeof LOOKS)[number],
  { center, radius }: Surroundings,
  size: number,
): Camera {
  const focal = size / 2 / tangent;
  const down: Vector3 = Math.abs(direction[1]) > 0.9 ? [0, 0, 1] : [0, 1, 0];
  return {
    ...{ width: size, height: size, fx: focal, fy: focal, cx: size / 2, cy: size / 2 },
    worldToCamera: lookAt(add(center, scale(direction, distance * radius)), center, scale(down, -1)),
    near: radius / 100,
    far: DEFAULT_FAR,
  };
}
