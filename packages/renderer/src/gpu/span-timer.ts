import { BUFFER_USAGE } from './kernel.js';
import type { FrameTimer } from './pass-timer.js';

/** Maximum number of frames in transit to the CPU; while it is reached, further frames are not timed. */
const SLOTS = 4;
const MAX_PASSES = 16;
const QUERIES = 2 * MAX_PASSES;
const QUERY_RESOLVE = 0x200;

/** The queries of one frame and their read-back buffer. */
interface Slot {
  readonly first: number;
  readonly resolved: GPUBuffer;
  readonly staging: GPUBuffer;
  isBusy: boolean;
}

/**
 * Measures the GPU time of frames in milliseconds: from the beginning of the first pass to the end of the last.
 * Designed for every frame of a page: all memory is allocated at once, nothing waits, and results arrive
 * asynchronously. GPU work of other pages between frames does not count.
 */
export class SpanTimer implements FrameTimer {
  readonly #queries: GPUQuerySet;
  readonly #slots: readonly Slot[];
  #slot: Slot | undefined;
  #onSpan: ((milliseconds: number | null) => void) | undefined;
  #passes = 0;
  /** Start of the last measured frame. */
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
   * @param onSpan Is called with its milliseconds, or with null if the GPU reported no plausible time.
   * @returns False if it cannot be timed because too many frames are in transit.
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
    // A frame that is divided into many submissions may have more passes: the last one overwrites the last pair.
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
      // Ignored, because the device is lost.
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

/** Plausible maximum of a frame, ms. */
const MAX_MS = 60_000;

/**
 * Returns the begin and the duration of a frame. A frame may be shorter than the resolution of the clock, 100 µs in
 * browsers, and then takes 0.
 * @param stamps Nanoseconds, in pairs.
 * @param before Begin of the previous frame, ns.
 * @returns Null milliseconds for clocks that have stopped since then, or run backwards.
 */
export function spanOf(stamps: BigUint64Array, before: bigint): [begin: bigint, milliseconds: number | null] {
  let [begin, end] = [stamps[0], stamps[1]];
  for (let i = 0; i < stamps.length; i += 2) {
    if (stamps[i] < begin) begin = stamps[i];
    if (stamps[i + 1] > end) end = stamps[i + 1];
  }
  const milliseconds = Number(end - begin) / 1e6;
  return [begin, begin > before && milliseconds >= 0 && milliseconds < MAX_MS ? milliseconds : null];
}
