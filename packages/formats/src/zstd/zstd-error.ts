/** A damaged or unreadable Zstandard stream; `byte` counts from the start of the stream. */
export class ZstdError extends Error {
  override readonly name = 'ZstdError';
  readonly byte: number;
  /** True if the stream ends too early, false if its content is wrong. */
  readonly isCut: boolean;

  constructor(message: string, byte: number, isCut = false) {
    super(message);
    this.byte = byte;
    this.isCut = isCut;
  }
}
