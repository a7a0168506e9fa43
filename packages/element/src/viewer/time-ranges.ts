/** Ranges of a scene's time, with the interface of TimeRanges, which scripts cannot construct. */
export class SceneTimeRanges {
  readonly #spans: readonly (readonly [start: number, end: number])[];

  /**
   * @param end Duration in seconds. NaN, 0 and Infinity give an empty list, other values one range from 0.
   * @param spans Ranges in seconds that replace this default.
   */
  constructor(
    end: number,
    spans: readonly (readonly [start: number, end: number])[] | undefined = end > 0 && end < Infinity ? [[0, end]] : [],
  ) {
    this.#spans = spans;
  }

  get length(): number {
    return this.#spans.length;
  }

  /** Returns the start of a range, seconds. @throws DOMException `IndexSizeError` for an index out of range */
  start(index: number): number {
    return this.#at(index)[0];
  }

  /** Returns the end of a range, seconds. @throws DOMException `IndexSizeError` for an index out of range */
  end(index: number): number {
    return this.#at(index)[1];
  }

  #at(index: number): readonly [number, number] {
    const span = this.#spans[index];
    if (span) return span;
    throw new DOMException(`there are ${this.length} spans, and no number ${index}`, 'IndexSizeError');
  }
}
