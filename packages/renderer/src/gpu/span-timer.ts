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
    const at = slot.first + 2 * this.#passes++;
    if (this.#passes > MAX_PASSES) return undefined;
    return { querySet: this.#queries, beginningOfPassWriteIndex: at, endOfPassWriteIndex: at + 1 };
  }

  endFrame(encoder: GPUCommandEncoder): void {
    const slot = this.#slot;
    // A frame of more passes, one divided into many submissions, is not known as a whole.
    if (slot === undefined || this.#passes === 0 || this.#passes > MAX_PASSES) return;
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
        onSpan(spanOf(stamps));
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

/** Nanoseconds by pairs to milliseconds; null for clocks that stand still or run backwards. */
export function spanOf(stamps: BigUint64Array): number | null {
  let [begin, end] = [stamps[0], stamps[1]];
  for (let i = 0; i < stamps.length; i += 2) {
    if (stamps[i] < begin) begin = stamps[i];
    if (stamps[i + 1] > end) end = stamps[i + 1];
  }
  const milliseconds = Number(end - begin) / 1e6;
  return begin > 0n && milliseconds > 0 && milliseconds < MOST_MS ? milliseconds : null;
}

/** No frame takes longer and is still alive, ms. */
const MOST_MS = 60_000;
