import type { Capacity, CapacityHistory, SampledFrame } from './capacity-history.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { copyCounts, type CountPlace } from './copy-counts.js';
import { constants } from './generated/shaders.js';
import type { Scratch } from './scratch.js';

/** Bounds of the capacity. The lower bound may change, so it is read at every sample. */
export interface CapacityBounds {
  readonly min: () => Capacity;
  readonly max: Capacity;
}

/** Maximum number of splats of a scene that gets capacity for all of them at once: 64 MB. */
const SMALL_SCENE = 1_300_000;
const MIN_PAIRS = 1 << 16;
/** Minimum capacity of nearly empty buffers. */
export const MIN_CAPACITY: Capacity = { visible: 1, pairs: MIN_PAIRS };
/** Initial capacity of small scenes in pairs, so that a close first frame fits: 32 MB. */
const GENEROUS_PAIRS = 1 << 21;
/** Factor of the capacity over the need. */
const HEADROOM = 1.25;
/** Usage above which the capacity grows, as a fraction of the capacity. */
const FULL = 0.92;
/** Usage below which the capacity shrinks, as a fraction of the capacity. */
const SLACK = 0.7;
/** Minimum number of bytes that a smaller capacity must free. */
const MIN_SAVING = 32 << 20;
const BYTES_PER_VISIBLE = 40;
const BYTES_PER_PAIR = 16;
/** Frames between two samples after the first frames. */
const INTERVAL = 16;
/**
 * Maximum milliseconds without a sample: the next frame is then sampled, because it may be the only one of its view.
 */
const LONGEST_PAUSE_MS = 250;

/** Pairs of splat and bin for each visible splat of a large scene. */
const PAIRS_PER_SPLAT = 1.5;
/**
 * Pairs of splat and bin for each splat of a budget. A fifth of the splats is never visible, and the splats of a frame
 * that uses the whole budget are small. Scenes of 10 and 16 million splats needed 0.93.
 */
export const PAIRS_PER_BUDGETED = 1.1;

/**
 * Bytes of six u32 counts: visible splats, splats beyond the capacity, pairs, pairs beyond the capacity, coverage, and
 * pairs of the longest list.
 */
const COUNT_BYTES = 24;

/**
 * Returns the capacity before the first frame.
 * @param splats Number of splats of the scenes.
 * @param isBudgeted Whether a splat budget limits streamed scenes.
 */
export function initialCapacity(splats: number, max: Capacity, isBudgeted = false): Capacity {
  const visible = Math.min(max.visible, splats <= SMALL_SCENE ? splats : Math.ceil(splats / 2));
  const usual = Math.ceil((isBudgeted ? PAIRS_PER_BUDGETED : PAIRS_PER_SPLAT) * visible);
  const pairs = Math.max(MIN_PAIRS, Math.min(4 * visible, GENEROUS_PAIRS), usual);
  return { visible, pairs: Math.min(max.pairs, pairs) };
}

/** Counts of one frame: drawn splats and pairs, and coverage. */
export interface FrameCounts extends Capacity {
  /** `cull_stats[COVERED]`: coverage of the frame, as a multiple of the frame times `COVERED_UNIT`. */
  readonly covered: number;
  /** Number of pairs of the longest list of the rasterizer `tiles`; 0 with `quads`. */
  readonly longest: number;
}

/**
 * Read-back buffers for the counts: one for the current monitor and one for the next. No buffer is created when scenes
 * change.
 */
export class CountBuffers {
  readonly #device: GPUDevice;
  readonly #free: GPUBuffer[];
  #isDestroyed = false;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.#free = [this.#make(), this.#make()];
  }

  take(): GPUBuffer {
    return this.#free.pop() ?? this.#make();
  }

  give(buffer: GPUBuffer): void {
    if (this.#isDestroyed) buffer.destroy();
    else this.#free.push(buffer);
  }

  destroy(): void {
    this.#isDestroyed = true;
    for (const buffer of this.#free) buffer.destroy();
  }

  #make(): GPUBuffer {
    const { mapRead, copyDestination } = BUFFER_USAGE;
    return this.#device.createBuffer({ label: 'gs.capacity', size: COUNT_BYTES, usage: mapRead | copyDestination });
  }
}

/**
 * Monitors the usage of the buffers, and requests a larger or smaller capacity. Counts arrive from the GPU one frame or
 * more later, and no frame waits for them. Nothing is read if the capacity suffices for every possible frame.
 */
export class CapacityMonitor {
  readonly #buffers: CountBuffers;
  readonly #staging: GPUBuffer;
  readonly #bounds: CapacityBounds;
  readonly #onResize: (capacity: Capacity, overflowed: boolean) => void;
  readonly #memory: CapacityHistory;
  #capacity: Capacity;
  #frame = 0;
  /** The last drawn frame. */
  #drawn: SampledFrame = { pixels: 0, wholePixels: 0, isWhole: true };
  /** The last sampled frame. */
  #image = this.#drawn;
  /** Time of the last sample in milliseconds, as `performance.now()` returns. */
  #sampledAt = -Infinity;
  #isReading = false;
  #isDestroyed = false;
  #idleSamples = 0;
  #recent: Capacity = { visible: 0, pairs: 0 };

  /**
   * @param buffers Read-back buffers of the counts.
   * @param capacity Current capacity.
   * @param memory History that earlier monitors of the scene have recorded.
   * @param onResize Called with the capacity that the next frame should have, and whether a frame lacked splats or
   * pairs.
   */
  constructor(
    buffers: CountBuffers,
    capacity: Capacity,
    bounds: CapacityBounds,
    memory: CapacityHistory,
    onResize: (capacity: Capacity, overflowed: boolean) => void,
  ) {
    this.#memory = memory;
    this.#capacity = capacity;
    this.#bounds = bounds;
    this.#onResize = onResize;
    this.#buffers = buffers;
    this.#staging = buffers.take();
  }

  /**
   * Counts a frame, and decides whether to sample it.
   * @param isOpen Whether counts matter even if all splats fit: the rasterizer makes pairs of splat and bin, or
   * overdraw is limited.
   * @param image The frame. A frame of another size or kind than the last sampled one is due at once.
   * @returns Whether to sample this frame; if so, call {@link record} before the submit.
   */
  isDue(isOpen: boolean, image: SampledFrame): boolean {
    const hasRoom = this.#capacity.visible >= this.#bounds.max.visible && !isOpen;
    this.#drawn = image;
    this.#frame++;
    const isInTurn =
      this.#frame % INTERVAL === 0 || (this.#frame < INTERVAL && Number.isInteger(Math.log2(this.#frame)));
    const now = performance.now();
    const isDue = isInTurn || !isAlike(image, this.#image) || now - this.#sampledAt > LONGEST_PAUSE_MS;
    if (!isDue || hasRoom || this.#isReading) return false;
    this.#image = image;
    this.#sampledAt = now;
    return true;
  }

  /**
   * Records the copy of a frame's counts to the read-back buffer, unless those of another frame are being read: a host
   * may record several frames before the first is read.
   * @returns Whether the copy was recorded. If so, call {@link read} after the submit.
   */
  record(
    encoder: GPUCommandEncoder,
    { plan, cullStats }: Pick<Scratch, 'plan' | 'cullStats'>,
    pairPlan: GPUBuffer | undefined,
    longest?: CountPlace,
  ): boolean {
    if (this.#isReading) return false;
    copyCounts(encoder, plan, pairPlan, this.#staging, 0);
    encoder.copyBufferToBuffer(cullStats, 4 * constants.COVERED, this.#staging, 16, 4);
    if (longest) encoder.copyBufferToBuffer(longest.buffer, longest.offset, this.#staging, 20, 4);
    return (this.#isReading = true);
  }

  /**
   * Reads the counts after {@link record}, and evaluates them with {@link judge}.
   * @returns The counts; undefined if the device was lost or this monitor was destroyed meanwhile.
   */
  read(): Promise<FrameCounts | undefined> {
    return this.#staging.mapAsync(0x1).then(
      () => {
        const [visible, hidden, pairs, lostPairs, covered, longest] = new Uint32Array(
          this.#staging.getMappedRange().slice(0),
        );
        this.#staging.unmap();
        this.#isReading = false;
        if (this.#isDestroyed) {
          this.#buffers.give(this.#staging);
          return undefined;
        }
        const used = { visible: visible + hidden, pairs: pairs + lostPairs };
        this.judge(used, hidden + lostPairs > 0, this.#image);
        return { visible, pairs, covered, longest };
      },
      () => undefined,
    );
  }

  destroy(): void {
    this.#isDestroyed = true;
    if (!this.#isReading) this.#buffers.give(this.#staging);
  }

  /**
   * Compares the need of a sampled frame with the capacity, and requests another capacity if required.
   * @param used Need of the frame: drawn splats and pairs, and those beyond the capacity.
   * @param overflowed Whether the frame lacked splats or pairs.
   * @param image The sampled frame.
   */
  judge(used: Capacity, overflowed: boolean, image = this.#drawn): void {
    this.#memory.note({ ...image, used, at: performance.now() });
    // Reserves the capacity of the frame at rest, which is shown before any measurement of it.
    const need = this.#memory.wholeNeedBy({ ...image, used });
    const min = this.#bounds.min();
    const grown = {
      visible: Math.max(min.visible, grow(need.visible, this.#capacity.visible, this.#bounds.max.visible)),
      pairs: Math.max(min.pairs, grow(need.pairs, this.#capacity.pairs, this.#bounds.max.pairs)),
    };
    if (grown.visible > this.#capacity.visible || grown.pairs > this.#capacity.pairs) {
      this.#memory.grow();
      this.#resize(grown, overflowed);
      return;
    }
    this.#recent = {
      visible: Math.max(this.#recent.visible, need.visible),
      pairs: Math.max(this.#recent.pairs, need.pairs),
    };
    if (++this.#idleSamples < this.#memory.looks) return;
    // The need of the last frame at rest is too low if the camera has come closer since then, so recent frames count, too.
    const whole = this.#memory.wholeNeed(image.wholePixels);
    const shrunk = {
      visible: shrink(Math.max(whole.visible, this.#recent.visible), this.#capacity.visible, min.visible),
      pairs: shrink(Math.max(whole.pairs, this.#recent.pairs), this.#capacity.pairs, min.pairs),
    };
    if (bytesOf(this.#capacity) - bytesOf(shrunk) >= MIN_SAVING) {
      this.#memory.shrink();
      this.#resize(shrunk, false);
    }
    this.#idleSamples = 0;
    this.#recent = { visible: 0, pairs: 0 };
  }

  #resize(capacity: Capacity, overflowed: boolean): void {
    this.#capacity = capacity;
    this.#onResize(capacity, overflowed);
  }
}

const isAlike = (a: SampledFrame, b: SampledFrame): boolean => a.pixels === b.pixels && a.isWhole === b.isWhole;

const grow = (used: number, room: number, max: number): number =>
  used > FULL * room ? Math.max(room, Math.min(max, Math.ceil(used * HEADROOM))) : room;

const shrink = (used: number, room: number, min: number): number =>
  used < SLACK * room ? Math.max(min, Math.ceil(used * HEADROOM)) : room;

export const bytesOf = ({ visible, pairs }: Capacity): number => BYTES_PER_VISIBLE * visible + BYTES_PER_PAIR * pairs;
