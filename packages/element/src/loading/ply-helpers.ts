/**
 * Distributes the work on a large PLY to helpers: workers that pack shards and sort blocks, in addition to the worker
 * that reads the file.
 */
import type { HelperAnswer, HelperRequest } from './pack-shards.js';
import { buffersOf } from './protocol.js';

/** Number of requests that each helper has at the same time, so that it continues with the next one without waiting. */
const AT_ONCE = 3;
/** Time without any answer after which helpers with open requests are given up, ms. */
const TIMEOUT_MS = 5_000;

interface Helper {
  readonly port: MessagePort;
  /** Tickets of the requests that the helper has not answered. */
  readonly open: Set<number>;
}

/** The source of the helpers' requests, and the receiver of their answers. */
export interface HelperWork {
  next(): HelperRequest | undefined;
  take(answer: HelperAnswer): void;
  /** Called with the unanswered tickets of a lost helper, which must be assigned again. */
  giveBack(tickets: Iterable<number>): void;
}

export class PlyHelpers {
  readonly #work: HelperWork;
  readonly #helpers: Helper[] = [];
  /** Buffers that helpers have returned, for reuse by later requests. */
  readonly rooms: ArrayBuffer[] = [];
  /** Current epoch of the work. Answers with an earlier epoch are ignored. */
  #epoch = 0;
  #wake: () => void = () => undefined;

  constructor(work: HelperWork) {
    this.#work = work;
  }

  get epoch(): number {
    return this.#epoch;
  }

  get areThere(): boolean {
    return this.#helpers.length > 0;
  }

  get areBusy(): boolean {
    return this.#helpers.some(({ open }) => open.size > 0);
  }

  add(port: MessagePort): void {
    const helper: Helper = { port, open: new Set() };
    this.#helpers.push(helper);
    port.addEventListener('message', ({ data }: MessageEvent<HelperAnswer>) => {
      if (data.room) this.rooms.push(data.room);
      if (data.epoch === this.#epoch && helper.open.delete(data.ticket)) this.#work.take(data);
      this.feed();
      this.#wake();
    });
    port.addEventListener('close', () => this.#giveUp(helper));
    port.start();
    this.feed();
  }

  /** Assigns available requests to the helpers, evenly, until each has {@link AT_ONCE}. */
  feed(): void {
    for (let round = 0; round < AT_ONCE; round++)
      for (const { port, open } of this.#helpers) {
        if (open.size > round) continue;
        const request = this.#work.next();
        if (request === undefined) return;
        open.add(request.ticket);
        port.postMessage(request, buffersOf('block' in request ? request.block : request.rows));
      }
  }

  /** Starts a new epoch: the answers to all open requests will be ignored. */
  forget(): void {
    this.#epoch++;
    for (const { open } of this.#helpers) open.clear();
  }

  /**
   * Waits for the next answer of any helper. If none arrives within {@link TIMEOUT_MS}, gives up all helpers with open
   * requests.
   */
  async answerSoon(): Promise<void> {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const isSilent = await new Promise<boolean>((resolve) => {
      this.#wake = () => resolve(false);
      timer = setTimeout(() => resolve(true), TIMEOUT_MS);
    });
    clearTimeout(timer);
    this.#wake = () => undefined;
    if (isSilent) for (const helper of [...this.#helpers]) if (helper.open.size > 0) this.#giveUp(helper);
  }

  #giveUp(helper: Helper): void {
    const at = this.#helpers.indexOf(helper);
    if (at < 0) return;
    this.#helpers.splice(at, 1);
    helper.port.close();
    this.#work.giveBack(helper.open);
    this.#wake();
  }
}
