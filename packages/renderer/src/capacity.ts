import type { Capacity, CapacityHistory, SampledFrame } from './capacity-history.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { copyCounts } from './copy-counts.js';
import { constants } from './generated/shaders.js';
import type { Scratch } from './scratch.js';

/** Between which bounds the room stays; the lower one may change, and is asked for at every look. */
export interface CapacityBounds {
  readonly least: () => Capacity;
  readonly most: Capacity;
}

/** Scenes up to this size get room for all their splats at once: 64 MB. */
const SMALL_SCENE = 1_300_000;
const LEAST_PAIRS = 1 << 16;
/** What buffers that are nearly empty may shrink to. */
export const LEAST_CAPACITY: Capacity = { visible: 1, pairs: LEAST_PAIRS };
/** Room for pairs that small scenes get without asking, so that a first frame from near by has it: 32 MB. */
const GENEROUS_PAIRS = 1 << 21;
/** More room than was needed. */
const HEADROOM = 1.25;
/** Share of the room that must be in use before there is more, or less. */
const FULL = 0.92;
const SLACK = 0.7;
/** Bytes that giving up room must free. */
const LEAST_SAVING = 32 << 20;
const BYTES_PER_VISIBLE = 40;
const BYTES_PER_PAIR = 16;
/** Frames between two looks once the first frames have been looked at. */
const INTERVAL = 16;
/** After so long without a look, ms, a frame is looked at whatever its number: it may be the only one of its view. */
const LONGEST_PAUSE_MS = 250;

/** Pairs for each visible splat of a large scene. */
const PAIRS_PER_SPLAT = 1.5;
/** Pairs for each splat of the budget, where a scene with levels of detail keeps to one: a fifth of them is never visible, and those that use it up are small. 0.93 were needed of 10 and of 16 million. */
const PAIRS_PER_BUDGETED = 1.1;

/** Visible splats, those without room, the same of pairs, and how often the frame is covered. */
const COUNT_BYTES = 20;

/** Room to begin with. */
export function initialCapacity(splats: number, most: Capacity, isBudgeted = false): Capacity {
  const visible = Math.min(most.visible, splats <= SMALL_SCENE ? splats : Math.ceil(splats / 2));
  const usual = Math.ceil((isBudgeted ? PAIRS_PER_BUDGETED : PAIRS_PER_SPLAT) * visible);
  const pairs = Math.max(LEAST_PAIRS, Math.min(4 * visible, GENEROUS_PAIRS), usual);
  return { visible, pairs: Math.min(most.pairs, pairs) };
}

/** What a frame had. */
export interface FrameCounts extends Capacity {
  /** `gathered[COVERED]` */
  readonly covered: number;
}

/** Buffers that counts are read from: one for the monitor at hand and one for the next, so that none is made when scenes come and go. */
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
 * Watches how full the buffers are and says when they should be larger or smaller. Counts come back from the GPU a frame or more
 * later, and nothing waits for them; where there is room for everything that can happen, nothing is read at all.
 */
export class CapacityMonitor {
  readonly #buffers: CountBuffers;
  readonly #staging: GPUBuffer;
  readonly #bounds: CapacityBounds;
  readonly #onResize: (capacity: Capacity, overflowed: boolean) => void;
  readonly #memory: CapacityHistory;
  #capacity: Capacity;
  #frame = 0;
  /** The last picture that was drawn, the last that was looked at, and when that was. */
  #drawn: SampledFrame = { pixels: 0, wholePixels: 0, isWhole: true };
  #picture = this.#drawn;
  #sampledAt = -Infinity;
  #isReading = false;
  #isDestroyed = false;
  #idleSamples = 0;
  #recent: Capacity = { visible: 0, pairs: 0 };

  /**
   * @param buffers what its counts are read from
   * @param memory what monitors before this one have learnt about the scene
   * @param onResize called with the room that the next frame should have
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
   * Counts a frame.
   * @param isOpen whether its counts matter however much room for splats there is: its rasterizer makes pairs of splat and bin, or its overdraw is limited
   * @param picture which it is: one of another size needs another room, and at rest no other follows
   * @returns whether this frame is one to look at; then {@link record} must be called before the submit and {@link read} after it
   */
  isDue(isOpen: boolean, picture: SampledFrame): boolean {
    const hasRoom = this.#capacity.visible >= this.#bounds.most.visible && !isOpen;
    this.#drawn = picture;
    this.#frame++;
    const isInTurn =
      this.#frame % INTERVAL === 0 || (this.#frame < INTERVAL && Number.isInteger(Math.log2(this.#frame)));
    const now = performance.now();
    const isDue = isInTurn || !isAlike(picture, this.#picture) || now - this.#sampledAt > LONGEST_PAUSE_MS;
    if (!isDue || hasRoom || this.#isReading) return false;
    this.#picture = picture;
    this.#sampledAt = now;
    return true;
  }

  /** Records the copy of the counts. */
  record(
    encoder: GPUCommandEncoder,
    { plan, gathered }: Pick<Scratch, 'plan' | 'gathered'>,
    pairPlan: GPUBuffer | undefined,
  ): void {
    copyCounts(encoder, plan, pairPlan, this.#staging, 0);
    encoder.copyBufferToBuffer(gathered, 4 * constants.COVERED, this.#staging, COUNT_BYTES - 4, 4);
    this.#isReading = true;
  }

  /**
   * Looks at the counts once they are there.
   * @returns what the frame had: undefined where the device is lost, or this monitor was destroyed meanwhile
   */
  read(): Promise<FrameCounts | undefined> {
    return this.#staging.mapAsync(0x1).then(
      () => {
        const [visible, hidden, pairs, lostPairs, covered] = new Uint32Array(this.#staging.getMappedRange().slice(0));
        this.#staging.unmap();
        this.#isReading = false;
        if (this.#isDestroyed) {
          this.#buffers.give(this.#staging);
          return undefined;
        }
        const used = { visible: visible + hidden, pairs: pairs + lostPairs };
        this.judge(used, hidden + lostPairs > 0, this.#picture);
        return { visible, pairs, covered };
      },
      () => undefined,
    );
  }

  destroy(): void {
    this.#isDestroyed = true;
    if (!this.#isReading) this.#buffers.give(this.#staging);
  }

  /**
   * Takes note of what a frame would have needed.
   * @param picture which it was
   */
  judge(used: Capacity, overflowed: boolean, picture = this.#drawn): void {
    this.#memory.note({ ...picture, used, at: performance.now() });
    // The picture at rest has no frame to learn from before it is seen.
    const need = this.#memory.wholeNeedBy({ ...picture, used });
    const least = this.#bounds.least();
    const grown = {
      visible: Math.max(least.visible, grow(need.visible, this.#capacity.visible, this.#bounds.most.visible)),
      pairs: Math.max(least.pairs, grow(need.pairs, this.#capacity.pairs, this.#bounds.most.pairs)),
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
    // Estimates are low where the view came nearer meanwhile.
    const whole = this.#memory.wholeNeed(picture.wholePixels);
    const shrunk = {
      visible: shrink(Math.max(whole.visible, this.#recent.visible), this.#capacity.visible, least.visible),
      pairs: shrink(Math.max(whole.pairs, this.#recent.pairs), this.#capacity.pairs, least.pairs),
    };
    if (bytesOf(this.#capacity) - bytesOf(shrunk) >= LEAST_SAVING) {
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

const grow = (used: number, room: number, most: number): number =>
  used > FULL * room ? Math.max(room, Math.min(most, Math.ceil(used * HEADROOM))) : room;

const shrink = (used: number, room: number, least: number): number =>
  used < SLACK * room ? Math.max(least, Math.ceil(used * HEADROOM)) : room;

const bytesOf = ({ visible, pairs }: Capacity): number => BYTES_PER_VISIBLE * visible + BYTES_PER_PAIR * pairs;
