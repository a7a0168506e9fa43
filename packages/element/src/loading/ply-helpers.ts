/** Workers that pack shards of a large PLY and sort blocks, in addition to the one that reads it. */
import type { HelperAnswer, HelperRequest } from './pack-shares.js';
import { buffersOf } from './protocol.js';

/** Requests of a helper in progress, so that the next one is queued when one is done. */
const AT_ONCE = 3;
/** Time without an answer after which a helper is not awaited any more, ms. */
const TIMEOUT_MS = 5_000;

interface Helper {
  readonly port: MessagePort;
  /** Unanswered tickets. */
  readonly open: Set<number>;
}

/** Source and destination of the helpers' work. */
export interface HelperWork {
  next(): HelperRequest | undefined;
  take(answer: HelperAnswer): void;
  /** Called with the tickets of a lost helper. */
  giveBack(tickets: Iterable<number>): void;
}

export class PlyHelpers {
  readonly #work: HelperWork;
  readonly #helpers: Helper[] = [];
  /** Memory that helpers have returned. */
  readonly rooms: ArrayBuffer[] = [];
  /** Epoch of the work: answers to earlier requests are ignored. */
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

  /** Assigns available work. */
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

  /** Restarts the work. */
  forget(): void {
    this.#epoch++;
    for (const { open } of this.#helpers) open.clear();
  }

  /** Waits for the next answer, and abandons helpers without any. */
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
