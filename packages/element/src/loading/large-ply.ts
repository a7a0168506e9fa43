/** Loaded by the worker for large PLYs: their rows are packed by several workers while the rest is on its way. */
import { MOST_DROPPED, splatRanges, type LoadLimits, type SplatRanges } from '@gaussian-splat/formats';
import { boundsOf } from '@gaussian-splat/core';
import { packGaussians } from '@gaussian-splat/renderer';
import {
  boundsOfPacked,
  JoinedBlocks,
  SHARE_SPLATS,
  ShareCells,
  sortBlock,
  type ShareCell,
  type ShareLayout,
} from '@gaussian-splat/renderer/tools';
import type { LoadListeners } from './load-scene.js';
import {
  layoutBy,
  packRows,
  release,
  type HelperAnswer,
  type HelperRequest,
  type ReadShare,
  type ShareRows,
} from './pack-shares.js';
import { PartPreviews } from './part-previews.js';
import { buffersOf, type LoadedScene, type SceneRequest } from './protocol.js';

/** Requests that a helper has at the same time: the next is there when one is done. */
const AT_ONCE = 3;
/** A helper that has answered nothing for so long is not waited for any more, ms. */
const PATIENCE_MS = 5_000;
/** Without a helper until then, shares are packed here while bytes arrive, ms. */
const ALONE_AFTER_MS = 500;
/** Messages are handled that often while bytes arrive, ms. */
const TURN_MS = 8;

type Rows = NonNullable<SplatRanges['rows']>;

interface Helper {
  readonly port: MessagePort;
  /** Tickets that it was given and has not answered. */
  readonly open: Set<number>;
}

/** A share that has been read. Its splats lie in their cells. */
type Share = ReadShare & { readonly count: number };

/** One PLY on its way. */
export class LargePly {
  readonly #name: string;
  readonly #rows: Rows;
  readonly #count: number;
  readonly #sh: SceneRequest['sh'];
  readonly #limits: () => LoadLimits;
  readonly #signal: AbortSignal;
  readonly #listeners: LoadListeners;
  /** Shares that have been read, in the order of the file; a cell takes those that follow one another. */
  readonly #shares: (Share | undefined)[];
  readonly #waiting = new Map<number, ReadShare>();
  readonly #helpers: Helper[] = [];
  readonly #previews: PartPreviews;
  readonly #began = performance.now();
  /** When messages were handled last. */
  #turned = 0;
  /** Shares below it have been handed out, or packed here. */
  #next = 0;
  /** Handed out to helpers that are gone. */
  readonly #again: number[] = [];
  #bytes: Uint8Array = new Uint8Array();
  #layout: ShareLayout | undefined;
  #cells: ShareCells | undefined;
  /** Shares below it lie in their cells. */
  #dealt = 0;
  /** Cells to be put in order, by their tickets. */
  readonly #blocks = new Map<number, ShareCell>();
  #joined: JoinedBlocks | undefined;
  /** Memory that helpers have given back. */
  readonly #rooms: ArrayBuffer[] = [];
  /** Counts the beginnings of the work. */
  #epoch = 0;
  #wake: () => void = () => undefined;

  /**
   * @param beginning of the file
   * @param total bytes of it
   * @returns undefined for a file that must be read whole
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
    // What is wrong with a header, or more than the page allows, those say who read it whole. The download keeps the limit of bytes.
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
    this.#name = name;
    this.#rows = rows;
    this.#count = count;
    this.#sh = sh;
    this.#limits = limits;
    this.#signal = signal;
    this.#listeners = listeners;
    this.#shares = new Array<undefined>(Math.ceil(count / SHARE_SPLATS));
    this.#previews = new PartPreviews(this.#shares.length, (preview) =>
      listeners.onPreview?.({
        packed: packGaussians(preview, { sh: 'int8' }),
        bounds: { ...boundsOf(preview), up: preview.hints?.up },
      }),
    );
    listeners.askForHelp?.(this.#shares.length, (port) => this.#addHelper(port));
  }

  /** More of the file is there: all bytes so far. */
  async onArrival(bytes: Uint8Array): Promise<void> {
    // The download has begun again, perhaps of another file.
    if (bytes.length < this.#bytes.length) this.#forget(undefined);
    this.#bytes = bytes;
    await this.#findLayout();
    this.#feed();
    const isAlone = this.#helpers.length === 0 && performance.now() - this.#began > ALONE_AFTER_MS;
    const request = isAlone ? this.#nextRequest() : undefined;
    if (request) await this.#workHere(request);
    if (this.#listeners.onPreview) this.#previews.showIfDue();
    // A download that never has to wait keeps the answers of helpers from this thread.
    if (this.#helpers.length > 0 && performance.now() - this.#turned > TURN_MS) {
      await turn();
      this.#turned = performance.now();
    }
  }

  /** The scene, once all bytes are there; undefined if something is wrong with them, which the reader of the whole file can say. */
  async finish(bytes: Uint8Array): Promise<LoadedScene | undefined> {
    this.#bytes = bytes;
    if (this.#arrived < this.#shares.length) return undefined;
    for (;;) {
      await this.#findLayout();
      if (!this.#layout) return undefined;
      await this.#workAll();
      // The reader of the whole file says that there is no time left, and why too much is dropped.
      if (this.#isLate || this.#dealt < this.#shares.length) return undefined;
      const count = this.#shares.reduce((sum, share) => sum + (share?.count ?? 0), 0);
      const droppedCount = this.#count - count;
      if (count === 0 || droppedCount > MOST_DROPPED * this.#count) return undefined;
      this.#listeners.onReading?.(true);
      const layout = this.#cells!.layoutFor(this.#sh);
      if (layout !== this.#layout) {
        this.#forget(layout);
        continue;
      }
      // From here on nothing can fail. Without the file a scene takes a third of the memory.
      release(bytes);
      const joined = await this.#join(layout, count);
      const first = this.#shares.find((share) => share?.shDegree !== undefined);
      const { antialiased = false, filterVariance, origin = [0, 0, 0], up, order, warnings } = first ?? {};
      const packed = joined.finish({ antialiased, filterVariance, origin, droppedCount });
      return { packed, bounds: { ...boundsOfPacked(packed), up }, order, warnings };
    }
  }

  /** By the first share. */
  async #findLayout(): Promise<void> {
    if (this.#layout || this.#arrived === 0) return;
    const precision = this.#sh === 'auto' ? 'int8' : this.#sh;
    for (let share = 0; share < this.#arrived && !this.#layout; share++)
      this.#layout = await layoutBy(this.#rowsOf(share), precision);
    this.#cells = this.#layout && new ShareCells(this.#layout);
  }

  /** Has all blocks put in order. */
  async #join(layout: ShareLayout, count: number): Promise<JoinedBlocks> {
    const joined = (this.#joined = new JoinedBlocks(layout, count));
    // The largest first: nobody waits for it in the end.
    const cells = this.#cells!.all().sort((a, b) => b.count - a.count);
    cells.forEach((cell, k) => {
      this.#blocks.set(this.#shares.length + k, cell);
      this.#again.push(this.#shares.length + k);
    });
    // The last is taken first.
    this.#again.reverse();
    this.#cells = undefined;
    this.#rooms.length = 0;
    await this.#workAll();
    return joined;
  }

  get #isLate(): boolean {
    const { maxSeconds = Infinity } = this.#limits();
    return maxSeconds <= 0;
  }

  /** Shares of which all bytes are there. */
  get #arrived(): number {
    const { start, byteLength } = this.#rows;
    const rows = Math.floor((this.#bytes.length - start) / byteLength);
    return rows >= this.#count ? this.#shares.length : Math.max(0, Math.floor(rows / SHARE_SPLATS));
  }

  #forget(layout: ShareLayout | undefined): void {
    this.#layout = layout;
    this.#cells = layout && new ShareCells(layout);
    this.#shares.fill(undefined);
    this.#waiting.clear();
    this.#again.length = this.#next = this.#dealt = 0;
    // Answers to requests of before are ignored.
    this.#epoch++;
    for (const { open } of this.#helpers) open.clear();
    this.#previews.forget();
  }

  #addHelper(port: MessagePort): void {
    const helper: Helper = { port, open: new Set() };
    this.#helpers.push(helper);
    port.addEventListener('message', ({ data }: MessageEvent<HelperAnswer>) => {
      if (data.room) this.#rooms.push(data.room);
      if (data.epoch === this.#epoch && helper.open.delete(data.ticket)) this.#take(data);
      this.#feed();
      this.#wake();
    });
    port.addEventListener('close', () => this.#giveUp(helper));
    port.start();
    this.#feed();
  }

  #giveUp(helper: Helper): void {
    const at = this.#helpers.indexOf(helper);
    if (at < 0) return;
    this.#helpers.splice(at, 1);
    helper.port.close();
    this.#again.push(...helper.open);
    this.#wake();
  }

  #take({ ticket, share, block }: HelperAnswer): void {
    if (block) this.#joined!.add(block);
    if (!share) return;
    if (share.preview) this.#previews.add(ticket, share.preview);
    this.#waiting.set(ticket, share);
    for (let next = this.#waiting.get(this.#dealt); next; next = this.#waiting.get(++this.#dealt)) {
      if (next.packed) this.#cells!.add(next.packed);
      this.#shares[this.#dealt] = { ...next, packed: undefined, preview: undefined, count: next.packed?.count ?? 0 };
      this.#waiting.delete(this.#dealt);
    }
  }

  /** Gives helpers what there is. */
  #feed(): void {
    for (let round = 0; round < AT_ONCE; round++)
      for (const { port, open } of this.#helpers) {
        if (open.size > round) continue;
        const request = this.#nextRequest();
        if (request === undefined) return;
        open.add(request.ticket);
        port.postMessage(request, buffersOf('block' in request ? request.block : request.rows));
      }
  }

  #nextRequest(): HelperRequest | undefined {
    const epoch = this.#epoch;
    if (!this.#layout) return undefined;
    const ticket = this.#again.pop() ?? (this.#next < this.#arrived ? this.#next++ : undefined);
    const cell = this.#blocks.get(ticket ?? -1);
    if (ticket !== undefined && cell) return { ticket, epoch, block: cell.block(this.#rooms.pop()) };
    return ticket === undefined ? undefined : { ticket, epoch, rows: this.#rowsOf(ticket), layout: this.#layout };
  }

  /** The file's header and the rows of a share: a PLY that has not come whole yet. */
  #rowsOf(share: number): ShareRows {
    const { start, byteLength } = this.#rows;
    const end = Math.min(this.#count, SHARE_SPLATS * (share + 1));
    const rows = this.#bytes.subarray(start + byteLength * SHARE_SPLATS * share, start + byteLength * end);
    const [length, room] = [start + rows.length, this.#rooms.pop()];
    const bytes = new Uint8Array(room && room.byteLength >= length ? room : new ArrayBuffer(length), 0, length);
    bytes.set(this.#bytes.subarray(0, start));
    bytes.set(rows, start);
    return { bytes, name: this.#name };
  }

  async #workHere(request: HelperRequest): Promise<void> {
    this.#listeners.onReading?.(true);
    const { ticket, epoch } = request;
    if ('block' in request) this.#take({ ticket, epoch, block: sortBlock(request.block) });
    else this.#take({ ticket, epoch, share: await packRows(request.rows, request.layout) });
  }

  /** Does all work there is, with what helpers there are, and here. */
  async #workAll(): Promise<void> {
    for (;;) {
      this.#signal.throwIfAborted();
      if (this.#isLate && !this.#joined) return;
      this.#feed();
      const isHelped = this.#helpers.some(({ open }) => open.size > 0);
      // Helpers put blocks in order; this thread has enough to do with what they answer.
      const request = isHelped && this.#joined ? undefined : this.#nextRequest();
      if (request) {
        await this.#workHere(request);
        await turn();
      } else if (isHelped) {
        await this.#answerSoon();
      } else {
        return;
      }
    }
  }

  /** Waits for the next answer, and gives up those from whom none comes. */
  async #answerSoon(): Promise<void> {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const isSilent = await new Promise<boolean>((resolve) => {
      this.#wake = () => resolve(false);
      timer = setTimeout(() => resolve(true), PATIENCE_MS);
    });
    clearTimeout(timer);
    this.#wake = () => undefined;
    if (isSilent) for (const helper of [...this.#helpers]) if (helper.open.size > 0) this.#giveUp(helper);
  }
}

let own: MessageChannel | undefined;

/** Lets messages that have come be handled. A timer would wait for 4 ms. */
function turn(): Promise<void> {
  const { port1, port2 } = (own ??= new MessageChannel());
  return new Promise((resolve) => {
    port1.onmessage = () => resolve();
    port2.postMessage(undefined);
  });
}
