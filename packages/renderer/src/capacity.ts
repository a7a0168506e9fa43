import { BUFFER_USAGE } from './gpu/kernel.js';
import { copyCounts } from './statistics.js';

/** For how much the buffers between the stages have room. */
export interface Capacity {
  /** Splats that are visible at once. */
  readonly visible: number;
  /** Pairs of splat and bin of the tiles. */
  readonly pairs: number;
}

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
/** Room for pairs that small scenes get without asking, so that a first frame from near by has it: 48 MB. */
const GENEROUS_PAIRS = 1 << 21;
/** More room than was needed. */
const HEADROOM = 1.25;
/** Share of the room that must be in use before there is more, or less. */
const FULL = 0.92;
const SLACK = 0.7;
/** Bytes that giving up room must free. */
const LEAST_SAVING = 32 << 20;
const BYTES_PER_VISIBLE = 48;
const BYTES_PER_PAIR = 24;
/** Frames between two looks once the first frames have been looked at. */
const INTERVAL = 16;
/** After so long without a look, ms, a frame is looked at whatever its number: it may be the only one of its view. */
const LONGEST_PAUSE_MS = 250;
/** Looks at buffers with room to spare before they shrink. */
const PATIENCE = 4;
/** So many times as many where they had to grow again: views that come and go, such as an orbit's, soon keep the room that the largest needs. */
const PATIENCE_GROWTH = 4;

const NOTHING: Capacity = { visible: 0, pairs: 0 };

/** Room to begin with. */
export function initialCapacity(splats: number, most: Capacity): Capacity {
  const visible = Math.min(most.visible, splats <= SMALL_SCENE ? splats : Math.ceil(splats / 2));
  const pairs = Math.max(LEAST_PAIRS, Math.min(4 * visible, GENEROUS_PAIRS), Math.ceil(1.5 * visible));
  return { visible, pairs: Math.min(most.pairs, pairs) };
}

/** What the monitors of a scene learn: how long room to spare is kept, and what the whole picture needs while pictures in motion have fewer pixels. */
export class CapacityMemory {
  #looks = PATIENCE;
  #hasShrunk = false;
  #whole = { pixels: 0, need: NOTHING };

  /** Looks at the buffers before they shrink. */
  get looks(): number {
    return this.#looks;
  }

  /** Room was given up. */
  shrink(): void {
    this.#hasShrunk = true;
  }

  /** There had to be more room. */
  grow(): void {
    if (this.#hasShrunk) this.#looks *= PATIENCE_GROWTH;
    this.#hasShrunk = false;
  }

  /** A picture was looked at that had all of so many pixels. */
  noteWhole(pixels: number, need: Capacity): void {
    this.#whole = { pixels, need };
  }

  /** What the last whole picture needed, if that had so many pixels. */
  wholeNeed(pixels: number): Capacity {
    return pixels === this.#whole.pixels ? this.#whole.need : NOTHING;
  }
}

/**
 * Watches how full the buffers are and says when they should be larger or smaller. Counts come back from the GPU a frame or more
 * later, and nothing waits for them; where there is room for everything that can happen, nothing is read at all.
 */
export class CapacityMonitor {
  readonly #staging: GPUBuffer;
  readonly #bounds: CapacityBounds;
  readonly #onWish: (capacity: Capacity, overflowed: boolean) => void;
  readonly #memory: CapacityMemory;
  #capacity: Capacity;
  #frame = 0;
  /** Pixels of the last picture that was looked at, of all of it had it been whole, and when that was. */
  #pixels = 0;
  #wholePixels = 0;
  #lookedAt = -Infinity;
  #isReading = false;
  #isDestroyed = false;
  #idleLooks = 0;
  #recent: Capacity = { visible: 0, pairs: 0 };

  /**
   * @param memory what monitors before this one have learnt about the scene
   * @param onWish called with the room that the next frame should have
   */
  constructor(
    device: GPUDevice,
    capacity: Capacity,
    bounds: CapacityBounds,
    memory: CapacityMemory,
    onWish: (capacity: Capacity, overflowed: boolean) => void,
  ) {
    this.#memory = memory;
    this.#capacity = capacity;
    this.#bounds = bounds;
    this.#onWish = onWish;
    const { mapRead, copyDestination } = BUFFER_USAGE;
    this.#staging = device.createBuffer({ label: 'gs.capacity', size: 16, usage: mapRead | copyDestination });
  }

  /**
   * Counts a frame.
   * @param hasPairs whether its rasterizer makes pairs of splat and bin
   * @param pixels of its picture: one of another size needs another room, and at rest no other follows
   * @param wholePixels of the picture at rest
   * @returns whether this frame is one to look at; then {@link record} must be called before the submit and {@link read} after it
   */
  isDue(hasPairs: boolean, pixels: number, wholePixels: number): boolean {
    const hasRoom = this.#capacity.visible >= this.#bounds.most.visible && !hasPairs;
    this.#frame++;
    const isInTurn =
      this.#frame % INTERVAL === 0 || (this.#frame < INTERVAL && Number.isInteger(Math.log2(this.#frame)));
    const now = performance.now();
    const isDue = isInTurn || pixels !== this.#pixels || now - this.#lookedAt > LONGEST_PAUSE_MS;
    if (!isDue || hasRoom || this.#isReading) return false;
    this.#pixels = pixels;
    this.#wholePixels = wholePixels;
    this.#lookedAt = now;
    return true;
  }

  /** Records the copy of the counts. */
  record(encoder: GPUCommandEncoder, plan: GPUBuffer, pairPlan: GPUBuffer | undefined): void {
    copyCounts(encoder, plan, pairPlan, this.#staging, 0);
    this.#isReading = true;
  }

  /**
   * Looks at the counts once they are there.
   * @returns what the frame had: undefined where the device is lost, or this monitor was destroyed meanwhile
   */
  read(): Promise<Capacity | undefined> {
    return this.#staging.mapAsync(0x1).then(
      () => {
        if (this.#isDestroyed) return undefined;
        const [visible, hidden, pairs, lostPairs] = new Uint32Array(this.#staging.getMappedRange().slice(0));
        this.#staging.unmap();
        this.#isReading = false;
        this.judge({ visible: visible + hidden, pairs: pairs + lostPairs }, hidden + lostPairs > 0);
        return { visible, pairs };
      },
      () => undefined,
    );
  }

  destroy(): void {
    this.#isDestroyed = true;
    this.#staging.destroy();
  }

  /** Takes note of what a frame would have needed. */
  judge(used: Capacity, overflowed: boolean): void {
    if (this.#pixels === this.#wholePixels) this.#memory.noteWhole(this.#pixels, used);
    const least = this.#bounds.least();
    const grown = {
      visible: Math.max(least.visible, grow(used.visible, this.#capacity.visible, this.#bounds.most.visible)),
      pairs: Math.max(least.pairs, grow(used.pairs, this.#capacity.pairs, this.#bounds.most.pairs)),
    };
    if (grown.visible > this.#capacity.visible || grown.pairs > this.#capacity.pairs) {
      this.#memory.grow();
      this.#wish(grown, overflowed);
      return;
    }
    this.#recent = {
      visible: Math.max(this.#recent.visible, used.visible),
      pairs: Math.max(this.#recent.pairs, used.pairs),
    };
    if (++this.#idleLooks < this.#memory.looks) return;
    // Pictures of fewer pixels do not take the room of the one that follows at rest.
    const whole = this.#memory.wholeNeed(this.#wholePixels);
    const shrunk = {
      visible: shrink(Math.max(whole.visible, this.#recent.visible), this.#capacity.visible, least.visible),
      pairs: shrink(Math.max(whole.pairs, this.#recent.pairs), this.#capacity.pairs, least.pairs),
    };
    if (bytesOf(this.#capacity) - bytesOf(shrunk) >= LEAST_SAVING) {
      this.#memory.shrink();
      this.#wish(shrunk, false);
    }
    this.#idleLooks = 0;
    this.#recent = { visible: 0, pairs: 0 };
  }

  #wish(capacity: Capacity, overflowed: boolean): void {
    this.#capacity = capacity;
    this.#onWish(capacity, overflowed);
  }
}

const grow = (used: number, room: number, most: number): number =>
  used > FULL * room ? Math.max(room, Math.min(most, Math.ceil(used * HEADROOM))) : room;

const shrink = (used: number, room: number, least: number): number =>
  used < SLACK * room ? Math.max(least, Math.ceil(used * HEADROOM)) : room;

const bytesOf = ({ visible, pairs }: Capacity): number => BYTES_PER_VISIBLE * visible + BYTES_PER_PAIR * pairs;
