import { BUFFER_USAGE } from './kernel.js';
import type { FrameTimer } from './pass-timer.js';

/** Frames that may be on their way back at once; while all are, further frames are not timed. */
const SLOTS = 4;
const MAX_PASSES = 16;
const QUERIES = 2 * MAX_PASSES;
const QUERY_RESOLVE = 0x200;

/** The queries of one frame and where they are read. */
interface Slot {
  readonly first: number;
  readonly resolved: GPUBuffer;
  readonly staging: GPUBuffer;
  isBusy: boolean;
}

/**
 * How long frames keep the GPU: from the begin of the first pass to the end of the last, milliseconds. Made for every frame of a page: all memory is
 * allocated at once, nothing waits, and results come when they come. What the GPU does between frames for others does not count.
 */
export class SpanTimer implements FrameTimer {
  readonly #queries: GPUQuerySet;
  readonly #slots: readonly Slot[];
  #slot: Slot | undefined;
  #onSpan: ((milliseconds: number | null) => void) | undefined;
  #passes = 0;
  /** Of the last frame that is known. */
  #begin = 0n;
  #isDestroyed = false;

  /** The device must have the feature `timestamp-query`. */
  constructor(device: GPUDevice) {
    this.#queries = device.createQuerySet({ label: 'gs.span', type: 'timestamp', count: SLOTS * QUERIES });
    const { copySource, copyDestination, mapRead } = BUFFER_USAGE;
    const buffer = (name: string, usage: number): GPUBuffer =>
      device.createBuffer({ label: `gs.span.${name}`, size: 8 * QUERIES, usage });
    this.#slots = Array.from({ length: SLOTS }, (_, k) => ({
      first: k * QUERIES,
      resolved: buffer('resolved', QUERY_RESOLVE | copySource),
      staging: buffer('staging', mapRead | copyDestination),
      isBusy: false,
    }));
  }

  /**
   * Times the next frame.
   * @param onSpan gets its milliseconds, or null where the GPU gave none that can be believed.
   * @returns false if it cannot be timed: too many are on their way
   */
  expect(onSpan: (milliseconds: number | null) => void): boolean {
    this.#onSpan = onSpan;
    return this.#slots.some(({ isBusy }) => !isBusy);
  }

  startFrame(): void {
    this.#passes = 0;
    this.#slot = this.#onSpan && this.#slots.find(({ isBusy }) => !isBusy);
  }

  timestampWrites(): GPUComputePassTimestampWrites | undefined {
    const slot = this.#slot;
    if (slot === undefined) return undefined;
    // A frame that is divided into many submissions may have more: the last of them leaves the last pair.
    if (this.#passes < MAX_PASSES) this.#passes++;
    const at = slot.first + 2 * (this.#passes - 1);
    return { querySet: this.#queries, beginningOfPassWriteIndex: at, endOfPassWriteIndex: at + 1 };
  }

  endFrame(encoder: GPUCommandEncoder): void {
    const slot = this.#slot;
    if (slot === undefined || this.#passes === 0) return;
    encoder.resolveQuerySet(this.#queries, slot.first, 2 * this.#passes, slot.resolved, 0);
    encoder.copyBufferToBuffer(slot.resolved, 0, slot.staging, 0, 16 * this.#passes);
    slot.isBusy = true;
  }

  submitted(): void {
    const [slot, onSpan, passes] = [this.#slot, this.#onSpan, this.#passes];
    this.#slot = this.#onSpan = undefined;
    if (onSpan === undefined) return;
    if (!slot?.isBusy) return onSpan(null);
    slot.staging.mapAsync(0x1).then(
      () => {
        if (this.#isDestroyed) return;
        const stamps = new BigUint64Array(slot.staging.getMappedRange(0, 16 * passes).slice(0));
        slot.staging.unmap();
        slot.isBusy = false;
        const [begin, milliseconds] = spanOf(stamps, this.#begin);
        this.#begin = begin;
        onSpan(milliseconds);
      },
      // A lost device: nobody waits any more.
      () => undefined,
    );
  }

  destroy(): void {
    this.#isDestroyed = true;
    this.#queries.destroy();
    for (const { resolved, staging } of this.#slots) {
      resolved.destroy();
      staging.destroy();
    }
  }
}

/** No frame takes longer and is still alive, ms. */
const MOST_MS = 60_000;

/**
 * When a frame began, and how long it took. A frame may be shorter than a step of the clock, which browsers make 100 µs, and so take nothing.
 * @param stamps nanoseconds, by pairs
 * @param before when the frame before began, ns
 * @returns null milliseconds for clocks that have stood still since then, or run backwards
 */
export function spanOf(stamps: BigUint64Array, before: bigint): [begin: bigint, milliseconds: number | null] {
  let [begin, end] = [stamps[0], stamps[1]];
  for (let i = 0; i < stamps.length; i += 2) {
    if (stamps[i] < begin) begin = stamps[i];
    if (stamps[i + 1] > end) end = stamps[i + 1];
  }
  const milliseconds = Number(end - begin) / 1e6;
  return [begin, begin > before && milliseconds >= 0 && milliseconds < MOST_MS ? milliseconds : null];
}
