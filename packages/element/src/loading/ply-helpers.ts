/** Workers that pack shares of a large PLY and put blocks in order, beside the one that reads it. */
import type { HelperAnswer, HelperRequest } from './pack-shares.js';
import { buffersOf } from './protocol.js';

/** Requests that a helper has at the same time: the next is there when one is done. */
const AT_ONCE = 3;
/** A helper that has answered nothing for so long is not waited for any more, ms. */
const TIMEOUT_MS = 5_000;

interface Helper {
  readonly port: MessagePort;
  /** Tickets that it was given and has not answered. */
  readonly open: Set<number>;
}

/** Where the work of helpers comes from, and where it goes. */
export interface HelperWork {
  next(): HelperRequest | undefined;
  take(answer: HelperAnswer): void;
  /** Was given to a helper that is gone. */
  giveBack(tickets: Iterable<number>): void;
}

export class PlyHelpers {
  readonly #work: HelperWork;
  readonly #helpers: Helper[] = [];
  /** Memory that helpers have given back. */
  readonly rooms: ArrayBuffer[] = [];
  /** Counts the beginnings of the work: answers to requests of before are ignored. */
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

  /** Gives them what there is. */
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

  /** The work begins anew. */
  forget(): void {
    this.#epoch++;
    for (const { open } of this.#helpers) open.clear();
  }

  /** Waits for the next answer, and gives up those from whom none comes. */
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
