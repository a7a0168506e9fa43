import { BUFFER_USAGE } from './kernel.js';
import { readBack } from './read-back.js';

/** Beginning and end of one pass of a frame, in milliseconds of the GPU's own clock. */
export interface PassTime {
  /** `project`, `sort`, `bin`, `rasterize` or `compose`. */
  readonly label: string;
  readonly begin: number;
  readonly end: number;
}

/** Records the beginning and the end of the passes of frames on the GPU. */
export interface FrameTimer {
  /** Called by the renderer at the beginning of each frame. */
  startFrame(): void;
  /** Returns the timestamp entry of a pass descriptor; undefined for a pass that is not timed. */
  timestampWrites(label: string): GPUComputePassTimestampWrites | undefined;
  /** Called by the renderer at the end of the frame, with its last encoder. */
  endFrame?(encoder: GPUCommandEncoder): void;
  /** Called after the submit of the frame. */
  submitted?(): void;
}

/** Maximum number of timestamps in a query set: WebGPU's limit. */
const MAX_QUERIES = 4096;
const QUERY_RESOLVE = 0x200;

/**
 * Records timestamps around the passes of many frames. They are read back together afterwards, so that a measurement
 * never waits between frames. Browsers round timestamps to 100 µs unless a flag disables this.
 */
export class PassTimer implements FrameTimer {
  readonly #device: GPUDevice;
  readonly #queries: GPUQuerySet;
  readonly #frames: string[][] = [];
  #used = 0;

  /** @param device A device with the feature `timestamp-query`. */
  constructor(device: GPUDevice) {
    this.#device = device;
    this.#queries = device.createQuerySet({ label: 'gs.timer', type: 'timestamp', count: MAX_QUERIES });
  }

  startFrame(): void {
    this.#frames.push([]);
  }

  /** Returns the timestamp entry of a pass; undefined if the query set is full. */
  timestampWrites(label: string): GPUComputePassTimestampWrites | undefined {
    if (this.#used + 2 > MAX_QUERIES) return undefined;
    this.#frames.at(-1)?.push(label);
    const at = this.#used;
    this.#used += 2;
    return { querySet: this.#queries, beginningOfPassWriteIndex: at, endOfPassWriteIndex: at + 1 };
  }

  /** Waits for the GPU, and resolves to the times of the passes of each frame since the last call. */
  async read(): Promise<PassTime[][]> {
    const [frames, count] = [this.#frames.splice(0), this.#used];
    this.#used = 0;
    if (count === 0) return [];
    const stamps = await this.#readStamps(count);
    const origin = stamps[0];
    const milliseconds = (i: number): number => Number(stamps[i] - origin) / 1e6;
    let at = 0;
    return frames.map((labels) =>
      labels.map((label) => {
        at += 2;
        return { label, begin: milliseconds(at - 2), end: milliseconds(at - 1) };
      }),
    );
  }

  destroy(): void {
    this.#queries.destroy();
  }

  async #readStamps(count: number): Promise<BigUint64Array> {
    const usage = QUERY_RESOLVE | BUFFER_USAGE.copySource;
    const resolved = this.#device.createBuffer({ label: 'gs.timer.resolved', size: 8 * count, usage });
    const encoder = this.#device.createCommandEncoder({ label: 'gs.timer' });
    encoder.resolveQuerySet(this.#queries, 0, count, resolved, 0);
    const [stamps] = await readBack(this.#device, [{ buffer: resolved }], encoder);
    resolved.destroy();
    return new BigUint64Array(stamps);
  }
}
