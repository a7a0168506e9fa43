/** Loaded by the worker for large PLYs: several workers pack their rows while the rest is in transit. */
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
import { packRows, release, type HelperAnswer, type HelperRequest } from './pack-shares.js';
import { PartPreviews } from './part-previews.js';
import { PlyHelpers, type HelperWork } from './ply-helpers.js';
import { PlyShares, type Rows } from './ply-shares.js';
import type { LoadedScene, SceneRequest, SentScene } from './protocol.js';

/** Time without a helper after which shards are packed here while bytes arrive, ms. */
const ALONE_AFTER_MS = 500;
/** Interval for handling messages while bytes arrive, ms. */
const TURN_MS = 8;

/** A PLY that is being downloaded. */
export class LargePly implements HelperWork {
  readonly #count: number;
  readonly #sh: SceneRequest['sh'];
  readonly #limits: () => LoadLimits;
  readonly #signal: AbortSignal;
  readonly #listeners: LoadListeners;
  readonly #shares: PlyShares;
  readonly #helpers = new PlyHelpers(this);
  readonly #previews: PartPreviews;
  readonly #began = performance.now();
  /** Time of the last handled messages. */
  #turned = 0;
  /** Shards below this index have been assigned, or packed here. */
  #next = 0;
  /** Tickets to assign first: of lost helpers, and of blocks. */
  readonly #again: number[] = [];
  /** Cells to be sorted, by their tickets. */
  readonly #blocks = new Map<number, ShareCell>();
  #joined: JoinedBlocks | undefined;

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
    signal: AbortSignal,
    listeners: LoadListeners,
  ): Promise<LargePly | undefined> {
    const { maxSplats = Infinity } = limits();
    // Reading the file as a whole reports invalid headers and exceeded limits. The download keeps the limit of bytes.
    const { rows, count = 0 } = (await splatRanges(beginning, name).catch(() => undefined)) ?? {};
    const isWhole =
      rows !== undefined && count > 0 && count <= maxSplats && rows.start + count * rows.byteLength <= total;
    return isWhole ? new LargePly(name, rows, count, sh, limits, signal, listeners) : undefined;
  }

  private constructor(
    name: string,
    rows: Rows,
    count: number,
    sh: SceneRequest['sh'],
    limits: () => LoadLimits,
    signal: AbortSignal,
    listeners: LoadListeners,
  ) {
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

  /** Call with all received bytes when more have arrived. */
  async onArrival(bytes: Uint8Array): Promise<void> {
    // The download has restarted, perhaps with another file.
    if (bytes.length < this.#shares.bytes.length) this.#forget(undefined);
    this.#shares.bytes = bytes;
    await this.#shares.findLayout(this.#sh);
    this.#helpers.feed();
    const isAlone = !this.#helpers.areThere && performance.now() - this.#began > ALONE_AFTER_MS;
    const request = isAlone ? this.next() : undefined;
    if (request) await this.#workHere(request);
    if (this.#listeners.onPreview) this.#previews.showIfDue();
    // A download that never waits keeps the answers of helpers from this thread.
    if (this.#helpers.areThere && performance.now() - this.#turned > TURN_MS) {
      await turn();
      this.#turned = performance.now();
    }
  }

  /** Returns the scene, once all bytes are received; undefined for a fault that reading the whole file reports. */
  async finish(bytes: Uint8Array): Promise<LoadedScene | SentScene | undefined> {
    const shares = this.#shares;
    shares.bytes = bytes;
    if (shares.arrived < shares.length) return undefined;
    for (;;) {
      await shares.findLayout(this.#sh);
      if (!shares.layout) return undefined;
      await this.#workAll();
      // Reading the file as a whole reports an exceeded time limit, and the reasons of dropped splats.
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
      // Nothing can fail from here on. Freeing the file reduces the memory of a scene to a third.
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

  /** Sorts all blocks. */
  async #join(joined: JoinedBlocks): Promise<void> {
    this.#joined = joined;
    // Largest first, so that none delays the end.
    const cells = this.#shares.takeCells().sort((a, b) => b.count - a.count);
    cells.forEach((cell, k) => {
      this.#blocks.set(this.#shares.length + k, cell);
      this.#again.push(this.#shares.length + k);
    });
    // The last is taken first.
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

  /** Runs all remaining work, on the available helpers and on this thread. */
  async #workAll(): Promise<void> {
    for (;;) {
      this.#signal.throwIfAborted();
      if (this.#isLate && !this.#joined) return;
      this.#helpers.feed();
      const isHelped = this.#helpers.areBusy;
      // Helpers sort blocks; this thread is busy with their answers.
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

/** The bounds of its chunks are sent when those of all are known. */
const ofSplats = ({ start, geometry, sh }: SortedBlock): PackedPortion => ({ start, geometry, sh });

let own: MessageChannel | undefined;

/** Yields for pending messages. A timer would wait for 4 ms. */
function turn(): Promise<void> {
  const { port1, port2 } = (own ??= new MessageChannel());
  return new Promise((resolve) => {
    port1.onmessage = () => resolve();
    port2.postMessage(undefined);
  });
}
