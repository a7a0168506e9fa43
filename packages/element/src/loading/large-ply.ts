/**
 * Reads a large PLY with several workers, which pack its rows while the rest is in transit. The worker loads this
 * module for the first large PLY.
 */
import { MAX_DROPPED_RATIO, splatRanges, type LoadLimits } from '@gaussian-splat/formats';
import { boundsOf } from '@gaussian-splat/core';
import { packGaussians } from '@gaussian-splat/renderer';
import {
  JoinedBlocks,
  sortBlock,
  type PackedPortion,
  type ShareCell,
  type ShareLayout,
  type SortedBlock,
} from '@gaussian-splat/renderer/tools';
import type { LoadListeners } from './load-scene.js';
import { packRows, release, type HelperAnswer, type HelperRequest } from './pack-shards.js';
import { PartPreviews } from './part-previews.js';
import { PlyHelpers, type HelperWork } from './ply-helpers.js';
import { PlyShares, type Rows } from './ply-shards.js';
import type { LoadedScene, SceneRequest, SentScene } from './protocol.js';

/** Time without a helper after which this thread itself packs shards while bytes arrive, ms. */
const ALONE_AFTER_MS = 500;
/** Interval after which this thread yields to pending messages while bytes arrive, ms. */
const TURN_MS = 8;

/**
 * Packs a PLY while it is downloaded. The work consists of tickets: shards of rows to pack, and later blocks to sort.
 */
export class LargePly implements HelperWork {
  /** Bytes of the file before the first row. */
  readonly #header: Uint8Array;
  readonly #count: number;
  readonly #sh: SceneRequest['sh'];
  readonly #limits: () => LoadLimits;
  readonly #signal: AbortSignal;
  readonly #listeners: LoadListeners;
  readonly #shares: PlyShares;
  readonly #helpers = new PlyHelpers(this);
  readonly #previews: PartPreviews;
  readonly #began = performance.now();
  /** Time when this thread last yielded to messages, in milliseconds of `performance.now()`. */
  #turned = 0;
  /** Index of the first shard that has been neither assigned to a helper nor packed by this thread. */
  #next = 0;
  /** Tickets that are assigned before new shards, the last one first: those of lost helpers, and those of blocks. */
  readonly #again: number[] = [];
  /** Cells whose splats must be sorted as blocks, by their tickets. */
  readonly #blocks = new Map<number, ShareCell>();
  #joined: JoinedBlocks | undefined;

  /**
   * Starts reading a file whose rows can be packed independently.
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
    signal: AbortSignal,
    listeners: LoadListeners,
  ): Promise<LargePly | undefined> {
    const { maxSplats = Infinity } = limits();
    // A file with an invalid header, or above the limit of splats, is read as a whole, which reports the fault. The
    // download itself checks the limit of bytes.
    const { rows, count = 0 } = (await splatRanges(beginning, name).catch(() => undefined)) ?? {};
    const isWhole =
      rows !== undefined && count > 0 && count <= maxSplats && rows.start + count * rows.byteLength <= total;
    if (!isWhole) return undefined;
    return new LargePly(name, beginning.slice(0, rows.start), rows, count, sh, limits, signal, listeners);
  }

  private constructor(
    name: string,
    header: Uint8Array,
    rows: Rows,
    count: number,
    sh: SceneRequest['sh'],
    limits: () => LoadLimits,
    signal: AbortSignal,
    listeners: LoadListeners,
  ) {
    this.#header = header;
    this.#count = count;
    this.#sh = sh;
    this.#limits = limits;
    this.#signal = signal;
    this.#listeners = listeners;
    this.#shares = new PlyShares(name, rows, count);
    this.#previews = new PartPreviews(this.#shares.length, (preview) =>
      listeners.onPreview?.({
        packed: packGaussians(preview, { sh: 'int8' }),
        bounds: { ...boundsOf(preview), up: preview.hints?.up },
      }),
    );
    listeners.askForHelp?.(this.#shares.length, (port) => this.#helpers.add(port));
  }

  /** Packs shards that have arrived. Call after each arrival of bytes, with all received bytes. */
  async onArrival(bytes: Uint8Array): Promise<void> {
    // The download has restarted, perhaps with another file, whose header `finish` compares.
    if (bytes.length < this.#shares.bytes.length) this.#forget(undefined);
    this.#shares.bytes = bytes;
    await this.#shares.findLayout(this.#sh);
    this.#helpers.feed();
    const isAlone = !this.#helpers.areThere && performance.now() - this.#began > ALONE_AFTER_MS;
    const request = isAlone ? this.next() : undefined;
    if (request) await this.#workHere(request);
    if (this.#listeners.onPreview) this.#previews.showIfDue();
    // A download that never waits would block the answers of helpers, which arrive as messages.
    if (this.#helpers.areThere && performance.now() - this.#turned > TURN_MS) {
      await turn();
      this.#turned = performance.now();
    }
  }

  /**
   * Returns the scene after the download. Undefined if bytes are missing or invalid, or if a restarted download has
   * brought a file with another header: the caller then reads the file as a whole, which reports a fault.
   */
  async finish(bytes: Uint8Array): Promise<LoadedScene | SentScene | undefined> {
    const shares = this.#shares;
    shares.bytes = bytes;
    if (shares.arrived < shares.length || !this.#header.every((byte, k) => byte === bytes[k])) return undefined;
    for (;;) {
      await shares.findLayout(this.#sh);
      if (!shares.layout) return undefined;
      await this.#workAll();
      // Reading the file as a whole reports an exceeded time limit, and why splats were dropped.
      if (this.#isLate || !shares.areAllDealt) return undefined;
      const count = shares.splats;
      const droppedCount = this.#count - count;
      if (count === 0 || droppedCount > MAX_DROPPED_RATIO * this.#count) return undefined;
      this.#listeners.onReading?.(true);
      const layout = shares.layoutFor(this.#sh);
      if (layout !== shares.layout) {
        this.#forget(layout);
        continue;
      }
      // Nothing can fail after this point. Freeing the file reduces the memory of the load to a third.
      release(bytes);
      const { antialiased = false, filterVariance, origin = [0, 0, 0], up, order, warnings } = shares.facts;
      const { onPart } = this.#listeners;
      const send = onPart && ((portion: SortedBlock): void => onPart({ portion: ofSplats(portion) }));
      const scene = { antialiased, filterVariance, origin, droppedCount };
      const joined = new JoinedBlocks(layout, count, scene, send);
      onPart?.({ head: joined.head });
      await this.#join(joined);
      const facts = { bounds: { ...joined.bounds, up }, order, warnings };
      if (!onPart) return { ...facts, packed: joined.packed };
      onPart({ portion: { chunks: joined.chunks } });
      return facts;
    }
  }

  next(): HelperRequest | undefined {
    const { layout, arrived } = this.#shares;
    const { epoch, rooms } = this.#helpers;
    if (!layout) return undefined;
    const ticket = this.#again.pop() ?? (this.#next < arrived ? this.#next++ : undefined);
    if (ticket === undefined) return undefined;
    const cell = this.#blocks.get(ticket);
    if (cell) return { ticket, epoch, block: cell.block(rooms.pop()) };
    return { ticket, epoch, rows: this.#shares.rowsOf(ticket, rooms.pop()), layout };
  }

  take({ ticket, share, block }: HelperAnswer): void {
    if (block) this.#joined!.add(block);
    if (!share) return;
    if (share.preview) this.#previews.add(ticket, share.preview);
    this.#shares.take(ticket, share);
  }

  giveBack(tickets: Iterable<number>): void {
    this.#again.push(...tickets);
  }

  /** Sorts the blocks of all cells, with the helpers, into the joined scene. */
  async #join(joined: JoinedBlocks): Promise<void> {
    this.#joined = joined;
    // The largest blocks are sorted first, so that a large one does not delay the end.
    const cells = this.#shares.takeCells().sort((a, b) => b.count - a.count);
    cells.forEach((cell, k) => {
      this.#blocks.set(this.#shares.length + k, cell);
      this.#again.push(this.#shares.length + k);
    });
    // `next` takes the last ticket first.
    this.#again.reverse();
    this.#helpers.rooms.length = 0;
    await this.#workAll();
  }

  get #isLate(): boolean {
    const { maxSeconds = Infinity } = this.#limits();
    return maxSeconds <= 0;
  }

  #forget(layout: ShareLayout | undefined): void {
    this.#shares.forget(layout);
    this.#again.length = this.#next = 0;
    this.#helpers.forget();
    this.#previews.forget();
  }

  async #workHere(request: HelperRequest): Promise<void> {
    this.#listeners.onReading?.(true);
    const { ticket, epoch } = request;
    if ('block' in request) this.take({ ticket, epoch, block: sortBlock(request.block) });
    else this.take({ ticket, epoch, share: await packRows(request.rows, request.layout) });
  }

  /**
   * Runs all remaining work on the available helpers and on this thread. Returns early if the time limit is exceeded
   * before blocks are sorted.
   */
  async #workAll(): Promise<void> {
    for (;;) {
      this.#signal.throwIfAborted();
      if (this.#isLate && !this.#joined) return;
      this.#helpers.feed();
      const isHelped = this.#helpers.areBusy;
      // Helpers sort the blocks alone if there are any, because their answers occupy this thread.
      const request = isHelped && this.#joined ? undefined : this.next();
      if (request) {
        await this.#workHere(request);
        await turn();
      } else if (isHelped) {
        await this.#helpers.answerSoon();
      } else {
        return;
      }
    }
  }
}

/**
 * Returns the splats of a block as a portion, without the bounds of chunks, which are sent at the end for all blocks.
 */
const ofSplats = ({ start, geometry, sh }: SortedBlock): PackedPortion => ({ start, geometry, sh });

let own: MessageChannel | undefined;

/** Yields to pending messages. A timer would take at least 4 ms. */
function turn(): Promise<void> {
  const { port1, port2 } = (own ??= new MessageChannel());
  return new Promise((resolve) => {
    port1.onmessage = () => resolve();
    port2.postMessage(undefined);
  });
}
