import { eyeOf, type Bounds, type Camera } from '@gaussian-splat/core';
import {
  GaussianBuffers,
  readPacked,
  Renderer,
  selectPacked,
  type GaussianScene,
  type PackedGaussians,
} from '@gaussian-splat/renderer';
import { MaskScene } from './gpu/mask-scene.js';
import { PictureErrors } from './gpu/picture-errors.js';
import type { MaskGoal } from './mask.js';
import { decibelsTogether } from './measure.js';
import { viewsAround } from './views.js';

/** Values of GPUBufferUsage and GPUTextureUsage, which Node has only where Dawn was loaded. */
const [MAP_READ, COPY_SOURCE, COPY_DESTINATION, STORAGE] = [1, 4, 8, 128];
const RENDER_ATTACHMENT = 16;
const CHUNK = 256;
const GEOMETRY_WORDS = 8;
/** Views that splats are scored in, those that a figure is searched in, and those that it is measured in. */
const [SCORED, SEARCHED, HELD_OUT] = [32, 4, 12];
/** Where looking takes so long, ms, so many views must do: any beginning of them is spread around the scene. */
const LONG_MS = 8_000;
const LEAST_VIEWS = 12;

/** Pixels of a view. */
export interface ViewSize {
  readonly width: number;
  readonly height: number;
}

const LARGEST_VIEW: ViewSize = { width: 480, height: 270 };
/** Fewer splats are larger, and seen as well in smaller views: so many pixels for each, and at least a quarter of each side. */
const PIXELS_OF_SPLAT = 16;
const LEAST_SCALE = 0.25;

/** Pixels of the views that so many splats are looked at in. */
export function viewSizeOf(count: number): ViewSize {
  const { width, height } = LARGEST_VIEW;
  const scale = Math.min(1, Math.max(LEAST_SCALE, Math.sqrt((PIXELS_OF_SPLAT * count) / (width * height))));
  return { width: Math.round(scale * width), height: Math.round(scale * height) };
}

/** A splat that fewer views looked at is kept: another view may show it in full. */
const MIN_LOOKS = 3;
const MOST_TRIES = 4;
/** Halvings of the share in the search for a figure, the least share, and how often and by how much more is kept than the search found. */
const HALVINGS = 6;
const LEAST_SHARE = 0.05;
const RAISES = 5;
const RAISE = 0.04;
/** How long others may have to wait for their turn, ms. */
const TURN_MS = 8;

export interface LiveMaskOptions {
  readonly signal?: AbortSignal;
  /** Pixels of the views; default 480 x 270, and less for scenes of less than 8,100 splats. */
  readonly viewSize?: ViewSize;
  /** Once looking has taken so long, ms, 12 of the 32 views must do; default 8 s. The mask then depends on how fast the GPU is. */
  readonly patienceMs?: number;
}

/** What is shown of a scene. */
export interface MaskedScene {
  readonly packed: PackedGaussians;
  /** dB to the whole scene in views that had no say, over the pixels that the whole covers; measured where a figure was asked for. */
  readonly decibels: number | null;
}

/**
 * A mask for a scene that is on the GPU already and whose cloud is gone: every splat is scored by what it contributes to views around the scene, and any
 * share of the most seen can be taken. The scene itself is left alone. Nothing blocks: the GPU does the looking, and the rest is done in turns of
 * milliseconds.
 */
export class LiveMask {
  /** All splats, as they were packed: what brings everything back. */
  readonly whole: PackedGaussians;
  readonly #device: GPUDevice;
  readonly #bounds: Bounds;
  /** By slot: the largest weight in any pixel. */
  readonly #weights: Float32Array;
  readonly #viewSize: ViewSize;

  private constructor(
    device: GPUDevice,
    bounds: Bounds,
    whole: PackedGaussians,
    weights: Float32Array,
    viewSize: ViewSize,
  ) {
    this.#device = device;
    this.#bounds = bounds;
    this.whole = whole;
    this.#weights = weights;
    this.#viewSize = viewSize;
  }

  /** Looks at a scene from all sides. Rejects with the signal's reason, GaussianSplatError `out-of-memory/*`, or if the device is lost. */
  static async of(
    device: GPUDevice,
    scene: GaussianScene,
    bounds: Bounds,
    { signal, viewSize = viewSizeOf(scene.count), patienceMs = LONG_MS }: LiveMaskOptions = {},
  ): Promise<LiveMask> {
    const views = viewsAround(bounds, SCORED, viewSize);
    const { weights, seen } = await contributionsIn(device, scene, views, patienceMs, signal);
    const whole = await readPacked(device, scene, () => signal?.throwIfAborted());
    signal?.throwIfAborted();
    await keepUnseen(weights, whole, views.slice(0, seen));
    signal?.throwIfAborted();
    return new LiveMask(device, bounds, whole, weights.subarray(0, whole.count), viewSize);
  }

  /** The splats that a goal leaves. Rejects likewise. */
  async masked(goal: MaskGoal, signal?: AbortSignal): Promise<MaskedScene> {
    if ('share' in goal) return { packed: await this.#take(goal.share), decibels: null };
    return this.#search(goal.decibels, signal);
  }

  async #take(share: number): Promise<PackedGaussians> {
    return selectPacked(this.whole, heaviest(this.#weights, this.#countOf(share)), turns());
  }

  #countOf(share: number): number {
    return Math.max(1, Math.round(share * this.whole.count));
  }

  /** The least share that keeps to a figure in some views, raised until it does in others. */
  async #search(asked: number, signal: AbortSignal | undefined): Promise<MaskedScene> {
    const gauge = await Gauge.of(this.#device, this.whole, signal);
    const around = (count: number, seed: number): readonly Camera[] =>
      viewsAround(this.#bounds, count, { ...this.#viewSize, seed });
    const slotsOf = (share: number): Uint32Array => heaviest(this.#weights, this.#countOf(share));
    try {
      const searched = await gauge.lookFrom(around(SEARCHED, 1));
      let [low, high] = [LEAST_SHARE, 1];
      for (let k = 0; k < HALVINGS; k++) {
        const middle = (low + high) / 2;
        if ((await searched(slotsOf(middle))) >= asked) high = middle;
        else low = middle;
      }
      const heldOut = await gauge.lookFrom(around(HELD_OUT, 2));
      for (let k = 0; k < RAISES; k++) {
        const share = Math.min(1, high + k * RAISE);
        const found = await heldOut(slotsOf(share));
        if (found >= asked) return { packed: await this.#take(share), decibels: found };
      }
      return { packed: this.whole, decibels: Infinity };
    } finally {
      gauge.destroy();
    }
  }
}

/** Tells how far pictures of some splats of a scene are from those of all. */
class Gauge {
  readonly #device: GPUDevice;
  readonly #renderer: Renderer;
  readonly #whole: GaussianBuffers;
  readonly #shown: MaskScene;
  readonly #errors: PictureErrors[] = [];
  readonly #signal: AbortSignal | undefined;

  private constructor(device: GPUDevice, whole: GaussianBuffers, shown: MaskScene, signal: AbortSignal | undefined) {
    this.#device = device;
    this.#signal = signal;
    this.#whole = whole;
    this.#shown = shown;
    this.#renderer = new Renderer(device);
  }

  static async of(device: GPUDevice, packed: PackedGaussians, signal: AbortSignal | undefined): Promise<Gauge> {
    signal?.throwIfAborted();
    const whole = await GaussianBuffers.upload(device, packed);
    try {
      return new Gauge(device, whole, await MaskScene.of(device, whole), signal);
    } catch (error) {
      whole.destroy();
      throw error;
    }
  }

  /** Draws all of the scene in some views. @returns what tells the dB of some splats, all views together */
  async lookFrom(views: readonly Camera[]): Promise<(slots: Uint32Array) => Promise<number>> {
    const errors = await PictureErrors.of(this.#device, this.#renderer, this.#whole, views, this.#pause);
    this.#errors.push(errors);
    return async (slots) => {
      this.#signal?.throwIfAborted();
      this.#shown.show(slots);
      return decibelsTogether(await errors.measure(this.#shown, this.#pause));
    };
  }

  destroy(): void {
    for (const errors of this.#errors) errors.destroy();
    this.#shown.destroy();
    this.#whole.destroy();
    this.#renderer.destroy();
  }

  /** The page's own frames come between. */
  readonly #pause = async (): Promise<void> => {
    await this.#device.queue.onSubmittedWorkDone();
    this.#signal?.throwIfAborted();
  };
}

/** The largest weight that each slot has in any pixel of any view, and how many views that are. */
async function contributionsIn(
  device: GPUDevice,
  scene: GaussianScene,
  views: readonly Camera[],
  patienceMs: number,
  signal: AbortSignal | undefined,
): Promise<{ weights: Float32Array; seen: number }> {
  const size = 4 * CHUNK * Math.max(1, Math.ceil(scene.count / CHUNK));
  const renderer = new Renderer(device, { rasterizer: 'tiles' });
  const noted = device.createBuffer({ label: 'gs.economy.noted', size, usage: STORAGE | COPY_SOURCE });
  const staging = device.createBuffer({ label: 'gs.economy.read', size, usage: MAP_READ | COPY_DESTINATION });
  const { width, height } = views[0];
  const target = device.createTexture({ size: [width, height], format: 'rgba16float', usage: RENDER_ATTACHMENT });
  try {
    const began = performance.now();
    let seen = 0;
    for (const camera of views) {
      if (seen >= LEAST_VIEWS && performance.now() - began > patienceMs) break;
      for (let tries = 0; tries < MOST_TRIES; tries++) {
        renderer.render({ gaussians: scene, camera, target, notes: { contributions: noted } });
        // The page's own frames come between.
        if (await renderer.isComplete()) break;
      }
      signal?.throwIfAborted();
      seen++;
    }
    const encoder = device.createCommandEncoder({ label: 'gs.economy.read' });
    encoder.copyBufferToBuffer(noted, 0, staging, 0, size);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(MAP_READ);
    return { weights: new Float32Array(staging.getMappedRange().slice(0)), seen };
  } finally {
    renderer.destroy();
    for (const resource of [noted, staging, target]) resource.destroy();
  }
}

/** Splats whose centre hardly any view had in its frame count as seen in full. */
async function keepUnseen(
  weights: Float32Array,
  { count, origin, geometry }: PackedGaussians,
  views: readonly Camera[],
): Promise<void> {
  const positions = new Float32Array(geometry.buffer, geometry.byteOffset, geometry.length);
  const looks = new Uint8Array(count);
  const pause = turns();
  for (const { worldToCamera: m, fx, fy, cx, cy, width, height, near, ...rest } of views) {
    const [ex, ey, ez] = eyeOf(m).map((value, axis) => value - origin[axis]);
    for (let i = 0; i < count; i++) {
      if (i % 16_384 === 0) await pause();
      const at = GEOMETRY_WORDS * i;
      const [x, y, z] = [positions[at] - ex, positions[at + 1] - ey, positions[at + 2] - ez];
      const depth = m[8] * x + m[9] * y + m[10] * z;
      if (depth < near || depth > rest.far) continue;
      const u = (fx * (m[0] * x + m[1] * y + m[2] * z)) / depth + cx;
      const v = (fy * (m[4] * x + m[5] * y + m[6] * z)) / depth + cy;
      if (u >= 0 && u < width && v >= 0 && v < height) looks[i]++;
    }
  }
  for (let i = 0; i < count; i++) if (looks[i] < MIN_LOOKS) weights[i] = 1;
}

/** Bits of a weight that its bin leaves out: those of a float32 up to 1 fill 65,025 bins. */
const BIN_SHIFT = 14;
const binOf = (bits: number): number => bits >>> BIN_SHIFT;
const BINS = binOf(0x3f800000) + 1;

/** The slots of the heaviest splats, ascending: by bins of weights, in linear time; within the last bin the first of the scene. Weightless ones never stay. */
export function heaviest(weights: Float32Array, count: number): Uint32Array {
  const bits = new Uint32Array(weights.buffer, weights.byteOffset, weights.length);
  const bins = new Uint32Array(BINS);
  let weightless = 0;
  for (const value of bits) {
    if (value === 0) weightless++;
    else bins[binOf(value)]++;
  }
  const kept = Math.min(count, bits.length - weightless);
  let bin = BINS;
  let heavier = 0;
  while (bin > 0 && heavier + bins[bin - 1] <= kept) heavier += bins[--bin];
  let spare = kept - heavier;
  const slots = new Uint32Array(kept);
  let at = 0;
  for (let slot = 0; slot < bits.length; slot++) {
    const value = bits[slot];
    if (value === 0) continue;
    const own = binOf(value);
    if (own >= bin || (own === bin - 1 && spare-- > 0)) slots[at++] = slot;
  }
  return slots;
}

/** Lets others have their turn once this one has taken its time. */
function turns(): () => Promise<void> {
  let began = performance.now();
  return async () => {
    if (performance.now() - began < TURN_MS) return;
    await new Promise((resolve) => setTimeout(resolve));
    began = performance.now();
  };
}
