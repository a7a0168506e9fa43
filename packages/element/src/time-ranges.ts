/** Spans of a scene's time in the shape of the platform's TimeRanges, which scripts cannot make. */
export class SceneTimeRanges {
  readonly #spans: readonly (readonly [start: number, end: number])[];

  /**
   * @param end seconds; NaN, 0 and Infinity make an empty list, others one span from 0
   * @param spans replaces that span
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

  /** Seconds. Throws an `IndexSizeError` for an index out of range. */
  start(index: number): number {
    return this.#at(index)[0];
  }

  /** Seconds, likewise. */
  end(index: number): number {
    return this.#at(index)[1];
  }

  #at(index: number): readonly [number, number] {
    const span = this.#spans[index];
    if (span) return span;
    throw new DOMException(`there are ${this.length} spans, and no number ${index}`, 'IndexSizeError');
  }
}
