/** Packs a large PLY while it is downloaded. The worker loads this module for the first large PLY. */
import { MAX_DROPPED_RATIO, readPrefix, splatRanges, type LoadLimits } from '@gaussian-splat/formats';
import type { GaussianCloud } from '@gaussian-splat/core';
import {
  boundsOfPacked,
  choosePrecision,
  JoinedBlocks,
  noiseIn,
  packerCode,
  previewOf,
  recentered,
  RowPacker,
  type RowLayout,
  type SortedBlock,
} from '@gaussian-splat/renderer/tools';
import { PreviewTimes } from './part-previews.js';
import type { LoadedScene, SceneRequest, SentScene, TaskListeners } from './protocol.js';
import { BATCH_ROWS, RowHelpers } from './row-helpers.js';

/** Maximum number of splats in a preview. */
const MAX_PREVIEW = 32_768;
/** Number of rows that contain the properties of the scene. */
const FIRST_ROWS = 1024;
/** Number of rows that determine the layout. Nothing is packed before they have arrived. */
const LAYOUT_ROWS = 1 << 14;
/** Number of bytes that this thread packs before it looks for an idle helper. */
const TURN_BYTES = 1 << 18;
/** Interval after which this thread yields to pending messages while bytes arrive, ms. */
const TURN_MS = 8;
/** Number of positions that are sampled to find how far the scene is from its origin. */
const POSITIONS = 4096;

interface Rows {
  readonly start: number;
  readonly byteLength: number;
  readonly columns: readonly number[];
}

/**
 * Packs the rows of a PLY as they arrive, so that the file is never in memory as a whole. After the last row only the
 * order of the splats is missing.
 */
export class LargePly {
  readonly #name: string;
  readonly #header: Uint8Array;
  readonly #rows: Rows;
  readonly #count: number;
  readonly #sh: SceneRequest['sh'];
  readonly #limits: () => LoadLimits;
  readonly #listeners: TaskListeners;
  readonly #previews = new PreviewTimes();
  readonly #helpers = new RowHelpers(({ first, count, bytes }) => this.#packer?.place(first, count, bytes));
  /** Properties of the scene, from the first rows. */
  #facts: GaussianCloud | undefined;
  #layout: RowLayout | undefined;
  #packer: RowPacker | undefined;
  #isRefused = false;
  /** Offset in the file of the next byte to pack. */
  #next = 0;
  /** The next batch for a helper, and the number of its bytes that have arrived. */
  #batch: Uint8Array<ArrayBuffer> | undefined;
  #filled = 0;
  /** Time when this thread last yielded to messages, in milliseconds of `performance.now()`. */
  #turned = 0;

  /**
   * @param beginning First bytes of the file.
   * @param total Size of the file in bytes.
   * @returns Undefined for a file that must be read as a whole.
   */
  static async open(
    beginning: Uint8Array,
    total: number,
    name: string,
    { sh }: SceneRequest,
    limits: () => LoadLimits,
    listeners: TaskListeners,
  ): Promise<LargePly | undefined> {
    const { maxSplats = Infinity } = limits();
    const { rows, count = 0 } = (await splatRanges(beginning, name).catch(() => undefined)) ?? {};
    const columns = rows?.columns;
    if (columns) void packerCode();
    if (!columns || count === 0 || count > maxSplats || rows.start + count * rows.byteLength > total) return undefined;
    return new LargePly(name, beginning.slice(0, rows.start), { ...rows, columns }, count, sh, limits, listeners);
  }

  private constructor(
    name: string,
    header: Uint8Array,
    rows: Rows,
    count: number,
    sh: SceneRequest['sh'],
    limits: () => LoadLimits,
    listeners: TaskListeners,
  ) {
    this.#name = name;
    this.#header = header;
    this.#rows = rows;
    this.#count = count;
    this.#sh = sh;
    this.#limits = limits;
    this.#listeners = listeners;
    listeners.askForHelp?.(Math.floor(count / BATCH_ROWS / 2), (port) => this.#helpers.add(port));
  }

  #hasTaken = false;
  /** Whether bytes of the file were not kept, so that it must be fetched again to be read as a whole. */
  get hasTaken(): boolean {
    return this.#hasTaken;
  }

  /**
   * Packs the received bytes.
   * @param bytes Received bytes from offset `first` of the file on.
   * @returns Whether they need not be kept.
   */
  async onArrival(bytes: Uint8Array, first = 0): Promise<boolean> {
    const { start, byteLength } = this.#rows;
    const end = first + bytes.length;
    // The download has restarted. Helpers may still have rows of the former one.
    if (end < this.#next) {
      this.#isRefused ||= this.#helpers.areBusy;
      this.#packer = this.#batch = undefined;
    }
    if (this.#isRefused) return false;
    if (!this.#packer) {
      const sample = start + byteLength * Math.min(this.#count, LAYOUT_ROWS);
      if (end < sample) return false;
      await this.#begin(bytes.subarray(0, sample));
      if (!this.#packer) return !(this.#isRefused = true);
      this.#hasTaken = true;
      this.#next = start;
    }
    const last = start + byteLength * this.#count;
    this.#pack(bytes.subarray(this.#next - first, Math.max(0, Math.min(end, last) - first)));
    this.#next = end;
    if (this.#listeners.onPreview && this.#previews.isDue(this.#packer!.count / this.#count))
      this.#previews.take(() => this.#showPreview());
    // A download that never waits would block the answers of helpers, which arrive as messages.
    if (this.#helpers.areThere && performance.now() - this.#turned > TURN_MS) {
      await turn();
      this.#turned = performance.now();
    }
    return true;
  }

  /** Packs the next bytes of the rows, or collects them for helpers. */
  #pack(bytes: Uint8Array): void {
    const packer = this.#packer!;
    for (let from = 0; from < bytes.length;) {
      if (!packer.missing) this.#batch ??= this.#helpers.room();
      const size = Math.min(
        bytes.length - from,
        this.#batch ? this.#batch.length - this.#filled : packer.missing || TURN_BYTES,
      );
      const part = bytes.subarray(from, (from += size));
      if (this.#batch) this.#fill(this.#batch, part);
      else packer.push(part);
    }
  }

  #fill(batch: Uint8Array<ArrayBuffer>, part: Uint8Array): void {
    batch.set(part, this.#filled);
    this.#filled += part.length;
    if (this.#filled < batch.length) return;
    this.#batch = undefined;
    this.#filled = 0;
    const first = this.#packer!.reserve(BATCH_ROWS);
    if (!this.#helpers.send({ first, bytes: batch })) this.#isRefused = true;
  }

  async #begin(beginning: Uint8Array): Promise<void> {
    if (!this.#header.every((byte, k) => byte === beginning[k])) return;
    const { start, byteLength, columns } = this.#rows;
    const cloud = await readPrefix(beginning.subarray(0, start + byteLength * FIRST_ROWS), { name: this.#name });
    if (cloud === undefined) return;
    const all = Uint32Array.from({ length: cloud.count }, (_, i) => i);
    const shPrecision = this.#sh === 'auto' ? choosePrecision(noiseIn(cloud, all), cloud.count) : this.#sh;
    const rows = (beginning.length - start) / byteLength;
    const view = new DataView(beginning.buffer, beginning.byteOffset + start);
    const count = Math.min(POSITIONS, rows);
    const positions = Float32Array.from({ length: 3 * count }, (_, k) =>
      view.getFloat32(byteLength * Math.floor((Math.floor(k / 3) * rows) / count) + columns[k % 3], true),
    );
    const near = recentered({ ...cloud, count, positions });
    const moved = near.origin.map((x, axis) => x - cloud.origin[axis]) as unknown as RowLayout['moved'];
    this.#facts = cloud;
    this.#layout = { shDegree: cloud.shDegree, shPrecision, moved };
    this.#packer = await RowPacker.open({ count: this.#count, byteLength, columns }, this.#layout);
    if (this.#packer) this.#helpers.begin({ byteLength, columns }, this.#layout);
  }

  #showPreview(): void {
    const { antialiased, filterVariance, hints } = this.#facts!;
    if (this.#packer!.count === 0) return;
    const { geometry, sh, chunks, count } = previewOf(this.#packer!, MAX_PREVIEW);
    const origin = this.#origin;
    this.#listeners.onPreview!({
      packed: {
        ...{ count, shDegree: 0, shPrecision: 'int8', antialiased, filterVariance, origin },
        ...{ droppedCount: 0, geometry, sh, chunks },
      },
      bounds: { ...boundsOfPacked(geometry, origin, 8, hints?.up), up: hints?.up },
    });
  }

  get #origin(): readonly [number, number, number] {
    const { moved } = this.#layout!;
    return this.#facts!.origin.map((x, axis) => x + moved[axis]) as unknown as readonly [number, number, number];
  }

  /** Returns the scene after the download; undefined if the file must be read as a whole, which reports a fault. */
  async finish(): Promise<LoadedScene | SentScene | undefined> {
    const [packer, layout, facts] = [this.#packer, this.#layout, this.#facts];
    if (!packer || !layout || !facts || this.#isRefused) return undefined;
    const { start, byteLength } = this.#rows;
    if (this.#next < start + byteLength * this.#count) return undefined;
    if (this.#batch) packer.push(this.#batch.subarray(0, this.#filled));
    await this.#helpers.settle();
    const droppedCount = this.#count - packer.count;
    const { maxSeconds = Infinity } = this.#limits();
    const isUnusual = packer.count === 0 || droppedCount > MAX_DROPPED_RATIO * this.#count;
    if (this.#helpers.hasLost || maxSeconds <= 0 || isUnusual) return undefined;
    this.#listeners.onReading?.(true);
    packer.sort();
    if (packer.precisionFor(this.#sh) !== layout.shPrecision) return undefined;
    const { antialiased, filterVariance, origin, hints, warnings } = facts;
    const { onPart } = this.#listeners;
    // The bounds of chunks are sent at the end for all blocks.
    const send = onPart && (({ start, geometry, sh }: SortedBlock) => onPart({ portion: { start, geometry, sh } }));
    const joined = new JoinedBlocks(layout, packer.count, { antialiased, filterVariance, origin, droppedCount }, send);
    void onPart?.({ head: joined.head });
    await packer.finish((block) => joined.add(block));
    const { up, order, credits } = hints ?? {};
    const own = { bounds: { ...joined.boundsFor(up), up }, order, warnings, credits };
    if (!onPart) return { ...own, packed: joined.packed };
    void onPart({ portion: { chunks: joined.chunks } });
    return own;
  }
}

let own: MessageChannel | undefined;

/** Yields to pending messages. A timer would take at least 4 ms. */
function turn(): Promise<void> {
  const { port1, port2 } = (own ??= new MessageChannel());
  return new Promise((resolve) => {
    port1.onmessage = () => resolve();
    port2.postMessage(undefined);
  });
}
