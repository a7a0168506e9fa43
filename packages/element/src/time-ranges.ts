/** Spans of a scene's time in the shape of the platform's TimeRanges, which scripts cannot make: none, or one from 0 on. */
export class SceneTimeRanges {
  readonly #end: number;

  /** @param end seconds; NaN, 0 and Infinity make an empty list. */
  constructor(end: number) {
    this.#end = Number.isFinite(end) && end > 0 ? end : 0;
  }

  get length(): number {
    return this.#end > 0 ? 1 : 0;
  }

  /** Seconds. Throws an `IndexSizeError` for a span that is not there. */
  start(index: number): number {
    this.#require(index);
    return 0;
  }

  /** Seconds, likewise. */
  end(index: number): number {
    this.#require(index);
    return this.#end;
  }

  #require(index: number): void {
    if (index >= 0 && index < this.length) return;
    throw new DOMException(`there are ${this.length} spans, and no number ${index}`, 'IndexSizeError');
  }
}
