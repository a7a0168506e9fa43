/** Loaded by the worker for large PLYs: their rows are packed by several workers while the rest is on its way. */
import { boundsOf } from '@gaussian-splat/core';
import { MOST_DROPPED, splatRanges, type LoadLimits, type SplatRanges } from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import { joinShares, SHARE_SPLATS, type PackedShare, type ShPrecision } from '@gaussian-splat/renderer/tools';
import type { LoadListeners } from './load-scene.js';
import { packRows, release, type ShareAnswer, type ShareRequest } from './pack-shares.js';
import { PartPreviews } from './part-previews.js';
import type { LoadedScene, SceneRequest } from './protocol.js';

/** Shares that a helper has at the same time: the next is there when one is done. */
const AT_ONCE = 2;
/** A helper that has answered nothing for so long is not waited for any more, ms. */
const PATIENCE_MS = 5_000;
/** Without a helper until then, shares are packed here while bytes arrive, ms. */
const ALONE_AFTER_MS = 500;

type Rows = NonNullable<SplatRanges['rows']>;

interface Helper {
  readonly port: MessagePort;
  /** Shares that it was given and has not answered. */
  readonly open: Set<number>;
}

/** One PLY on its way. */
export class LargePly {
  readonly #name: string;
  readonly #rows: Rows;
  readonly #count: number;
  readonly #sh: SceneRequest['sh'];
  readonly #limits: () => LoadLimits;
  readonly #signal: AbortSignal;
  readonly #listeners: LoadListeners;
  readonly #answers: (ShareAnswer | undefined)[];
  readonly #helpers: Helper[] = [];
  readonly #previews: PartPreviews;
  readonly #began = performance.now();
  /** Shares below it have been handed out, or packed here. */
  #next = 0;
  /** Handed out to helpers that are gone. */
  readonly #again: number[] = [];
  #bytes: Uint8Array = new Uint8Array();
  #precision: ShPrecision;
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
    this.#precision = sh === 'auto' ? 'int8' : sh;
    this.#answers = new Array<undefined>(Math.ceil(count / SHARE_SPLATS));
    this.#previews = new PartPreviews(this.#answers.length, (preview) =>
      listeners.onPreview?.({
        packed: packGaussians(preview, { sh: 'int8' }),
        bounds: { ...boundsOf(preview), up: preview.hints?.up },
      }),
    );
    listeners.askForHelp?.(this.#answers.length, (port) => this.#addHelper(port));
  }

  /** More of the file is there: all bytes so far. */
  async onArrival(bytes: Uint8Array): Promise<void> {
    // The download has begun again, perhaps of another file.
    if (bytes.length < this.#bytes.length) this.#forget();
    this.#bytes = bytes;
    this.#feed();
    const isAlone = this.#helpers.length === 0 && performance.now() - this.#began > ALONE_AFTER_MS;
    if (isAlone && this.#next < this.#arrived) await this.#packHere(this.#next++);
    if (this.#listeners.onPreview) this.#previews.showIfDue();
  }

  /** The scene, once all bytes are there; undefined where something is wrong with them, which those who read the whole file can say. */
  async finish(bytes: Uint8Array): Promise<LoadedScene | undefined> {
    this.#bytes = bytes;
    if (this.#arrived < this.#answers.length) return undefined;
    for (;;) {
      await this.#packAll();
      // Who reads it whole says that there is no time left.
      if (this.#isLate) return undefined;
      const shares = this.#answers.map((answer) => answer?.packed);
      const first = this.#answers.find((answer) => answer?.packed);
      if (!first || shares.includes(undefined)) return undefined;
      const { shDegree = 0, antialiased = false, filterVariance, origin = [0, 0, 0], up, order, warnings } = first;
      const packed = shares as PackedShare[];
      const droppedCount = this.#count - packed.reduce((sum, { count }) => sum + count, 0);
      // Who reads it whole says why.
      if (droppedCount > MOST_DROPPED * this.#count) return undefined;
      this.#listeners.onReading?.(true);
      const facts = { shDegree, antialiased, filterVariance, origin, droppedCount };
      // Without the file and the shares a scene takes a third of the memory.
      const onSettled = (): void => release(bytes);
      const joined = joinShares(packed, { sh: this.#sh, onSettled, release }, facts);
      if (typeof joined !== 'string') {
        const { positions, opacities } = joined;
        const bounds = boundsOf({ count: opacities.length, positions, opacities, origin });
        return { packed: joined.packed, bounds: { ...bounds, up }, order, warnings };
      }
      // Its colours need another precision than was taken for granted.
      this.#precision = joined;
      this.#forget();
    }
  }

  get #isLate(): boolean {
    const { maxSeconds = Infinity } = this.#limits();
    return maxSeconds <= 0;
  }

  /** Shares of which all bytes are there. */
  get #arrived(): number {
    const { start, byteLength } = this.#rows;
    const rows = Math.floor((this.#bytes.length - start) / byteLength);
    return rows >= this.#count ? this.#answers.length : Math.max(0, Math.floor(rows / SHARE_SPLATS));
  }

  #forget(): void {
    this.#answers.fill(undefined);
    this.#again.length = 0;
    this.#next = 0;
    // What they still answer is of no use.
    for (const { open } of this.#helpers) open.clear();
    this.#previews.forget();
  }

  #addHelper(port: MessagePort): void {
    const helper: Helper = { port, open: new Set() };
    this.#helpers.push(helper);
    port.addEventListener('message', ({ data }: MessageEvent<ShareAnswer>) => {
      if (helper.open.delete(data.share)) this.#keep(data);
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

  #keep(answer: ShareAnswer): void {
    this.#answers[answer.share] = answer;
    if (answer.preview) this.#previews.add(answer.share, answer.preview);
  }

  /** Gives helpers what there is. */
  #feed(): void {
    for (let round = 0; round < AT_ONCE; round++)
      for (const { port, open } of this.#helpers) {
        if (open.size > round) continue;
        const share = this.#take();
        if (share === undefined) return;
        open.add(share);
        const request = this.#request(share);
        port.postMessage(request, [request.bytes.buffer]);
      }
  }

  #take(): number | undefined {
    return this.#again.pop() ?? (this.#next < this.#arrived ? this.#next++ : undefined);
  }

  /** The file's header and the rows of a share: a PLY that has not come whole yet. */
  #request(share: number): ShareRequest {
    const { start, byteLength } = this.#rows;
    const end = Math.min(this.#count, SHARE_SPLATS * (share + 1));
    const rows = this.#bytes.subarray(start + byteLength * SHARE_SPLATS * share, start + byteLength * end);
    const bytes = new Uint8Array(start + rows.length);
    bytes.set(this.#bytes.subarray(0, start));
    bytes.set(rows, start);
    return { share, bytes, shPrecision: this.#precision, name: this.#name };
  }

  async #packHere(share: number): Promise<void> {
    this.#listeners.onReading?.(true);
    this.#keep(await packRows(this.#request(share)));
  }

  /** With what helpers there are, and here. */
  async #packAll(): Promise<void> {
    for (;;) {
      this.#signal.throwIfAborted();
      if (this.#isLate) return;
      this.#feed();
      const share = this.#take();
      if (share !== undefined) {
        await this.#packHere(share);
        await turn();
      } else if (this.#helpers.some(({ open }) => open.size > 0)) {
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

/** Lets messages be heard. */
const turn = (): Promise<void> => new Promise((resolve) => setTimeout(resolve));
