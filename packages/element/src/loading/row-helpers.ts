/** Distributes the rows of a large PLY to other workers, beside the worker that reads the file. */
import type { PackableRows, RowLayout } from '@gaussian-splat/renderer/tools';
import type { HelperTask, PackedBatch, RowBatch } from './pack-rows.js';

/** Number of batches that each helper has at the same time, so that it continues without waiting. */
const AT_ONCE = 3;
/** Time without any answer after which helpers with open batches are given up, ms. */
const TIMEOUT_MS = 5_000;
/** Number of rows of a batch. */
export const BATCH_ROWS = 1 << 13;

interface Helper {
  readonly port: MessagePort;
  /** Number of batches that the helper has not answered. */
  open: number;
}

export class RowHelpers {
  readonly #take: (batch: PackedBatch & { readonly count: number }) => void;
  readonly #helpers: Helper[] = [];
  /** Buffers that helpers have returned, for later batches. */
  readonly #rooms: Uint8Array<ArrayBuffer>[] = [];
  #task: HelperTask | undefined;
  #hasLost = false;
  #wake: () => void = () => undefined;

  /** @param take Receives the splats of each batch. */
  constructor(take: (batch: PackedBatch & { readonly count: number }) => void) {
    this.#take = take;
  }

  /** Whether a batch was lost with its helper, so that its rows must be read again. */
  get hasLost(): boolean {
    return this.#hasLost;
  }

  get areThere(): boolean {
    return this.#helpers.length > 0;
  }

  get areBusy(): boolean {
    return this.#helpers.some(({ open }) => open > 0);
  }

  /** Adds a helper by its port. */
  add(port: MessagePort): void {
    const helper: Helper = { port, open: 0 };
    this.#helpers.push(helper);
    port.onmessage = ({ data }: MessageEvent<PackedBatch>) => this.#receive(helper, data);
    port.addEventListener('close', () => this.#giveUp(helper));
    if (this.#task) port.postMessage(this.#task);
  }

  /** Begins a scene. */
  begin(rows: Omit<PackableRows, 'count'>, layout: RowLayout): void {
    this.#task = { rows: { ...rows, count: BATCH_ROWS }, layout };
    for (const { port } of this.#helpers) port.postMessage(this.#task);
  }

  /** Returns a buffer for the next batch; undefined if all helpers are busy. */
  room(): Uint8Array<ArrayBuffer> | undefined {
    if (!this.#task || !this.#helpers.some(({ open }) => open < AT_ONCE)) return undefined;
    return this.#rooms.pop() ?? new Uint8Array(BATCH_ROWS * this.#task.rows.byteLength);
  }

  /** Sends a full batch to the helper with the fewest. Returns false if there is none any more. */
  send(batch: RowBatch): boolean {
    if (this.#helpers.length === 0) return false;
    const helper = this.#helpers.reduce((idle, each) => (each.open < idle.open ? each : idle));
    helper.open++;
    helper.port.postMessage(batch, [batch.bytes.buffer]);
    return true;
  }

  /** Resolves when all batches are answered, or lost. */
  async settle(): Promise<void> {
    while (this.areBusy) {
      let timer: ReturnType<typeof setTimeout> | undefined;
      const isSilent = await new Promise<boolean>((resolve) => {
        this.#wake = () => resolve(false);
        timer = setTimeout(() => resolve(true), TIMEOUT_MS);
      });
      clearTimeout(timer);
      if (isSilent) for (const helper of [...this.#helpers]) if (helper.open > 0) this.#giveUp(helper);
    }
  }

  #receive(helper: Helper, { count, ...batch }: PackedBatch): void {
    helper.open--;
    this.#rooms.push(batch.bytes);
    if (count === undefined) this.#giveUp(helper, true);
    else this.#take({ ...batch, count });
    this.#wake();
  }

  #giveUp(helper: Helper, isLost = helper.open > 0): void {
    const at = this.#helpers.indexOf(helper);
    if (at < 0) return;
    this.#helpers.splice(at, 1);
    helper.port.close();
    helper.open = 0;
    this.#hasLost ||= isLost;
    this.#wake();
  }
}
