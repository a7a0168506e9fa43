import type { LoadedBytes } from './loaded-bytes.js';

/** Wire types of protobuf: https://protobuf.dev/programming-guides/encoding/ */
const VARINT = 0;
const FIXED64 = 1;
const LENGTH_DELIMITED = 2;
const FIXED32 = 5;

/** A byte range of a file: a message, or the payload of a field. */
export interface Span {
  readonly start: number;
  readonly end: number;
}

/**
 * Iterates over the fields of one protobuf message. Payloads are not read: the cursor skips them by their length, even
 * gigabytes.
 */
export class FieldCursor implements Span {
  readonly #bytes: LoadedBytes;
  readonly #limit: number;
  /** Byte offset of the next field. */
  offset: number;
  /** Number of the current field. */
  number = 0;
  /** Value of the current field if it is a varint; otherwise 0. */
  value = 0;
  /** Offset of the payload of a length-delimited field; otherwise 0. */
  start = 0;
  /** Offset after the payload of a length-delimited field; otherwise 0. */
  end = 0;
  #wireType = 0;

  constructor(bytes: LoadedBytes, { start, end }: Span) {
    this.#bytes = bytes;
    this.offset = start;
    this.#limit = end;
  }

  /** Whether the current field is a string, bytes or a message. */
  get isDelimited(): boolean {
    return this.#wireType === LENGTH_DELIMITED;
  }

  /** Whether the current field is a varint. */
  get isVarint(): boolean {
    return this.#wireType === VARINT;
  }

  /**
   * Advances to the next field. @returns False at the end of the message. After `NotLoaded` is thrown, the call can be
   * repeated.
   */
  next(): boolean {
    if (this.offset >= this.#limit) return false;
    this.#bytes.countField(this.offset);
    const tag = this.#varint(this.offset);
    this.number = Math.floor(tag.value / 8);
    this.#wireType = tag.value % 8;
    if (this.number < 1 || this.number > 536_870_911) throw this.#corrupt(`field number ${this.number}`);
    this.value = this.start = this.end = 0;
    this.offset = this.#payload(tag.end);
    return true;
  }

  /**
   * Returns the payload of the current field as text. @param limit Maximum length in bytes; longer text is
   * `decode/corrupt`.
   */
  text(limit: number): string {
    if (!this.isDelimited) throw this.#corrupt(`a number where a text belongs (field ${this.number})`);
    const length = this.end - this.start;
    if (length > limit) throw this.#corrupt(`a text of ${length} bytes where at most ${limit} are expected`);
    return this.#bytes.textAt(this.start, length);
  }

  /** Records the payload of the current field, and returns the offset after it. */
  #payload(start: number): number {
    switch (this.#wireType) {
      case VARINT: {
        const { value, end } = this.#varint(start);
        this.value = value;
        return end;
      }
      case FIXED64:
        return this.#within(start, 8);
      case FIXED32:
        return this.#within(start, 4);
      case LENGTH_DELIMITED: {
        const { value: length, end } = this.#varint(start);
        this.start = end;
        this.end = this.#within(end, length);
        return this.end;
      }
      default:
        throw this.#corrupt(`wire type ${this.#wireType}`);
    }
  }

  #within(start: number, length: number): number {
    const end = start + length;
    if (length >= 0 && end <= this.#limit) return end;
    // The outermost message ends at the end of the file.
    if (this.#limit === this.#bytes.size && length >= 0) {
      const found = `the end of the file at byte ${this.#bytes.size}`;
      throw this.#bytes.fault('decode/truncated', start, `${length} bytes of field ${this.number}`, found);
    }
    throw this.#corrupt(`a length of ${length} bytes for field ${this.number}, beyond the message that holds it`);
  }

  /**
   * Reads a varint as a signed 64-bit integer: 7 bits in each byte, low bits first. Returns its value and the offset
   * after it.
   */
  #varint(start: number): { value: number; end: number } {
    let value = 0;
    let factor = 1;
    for (let i = 0; i < 10; i++) {
      const at = start + i;
      if (at >= this.#limit) {
        if (this.#limit === this.#bytes.size) {
          throw this.#bytes.fault('decode/truncated', at, 'the rest of a number', 'the end of the file');
        }
        throw this.#corrupt('a number that runs beyond the message that holds it');
      }
      const byte = this.#bytes.byteAt(at);
      value += (byte % 128) * factor;
      factor *= 128;
      // Negative numbers take all ten bytes. Below -2^53 a few low bits are lost, which affects no field that is read
      // here.
      if (byte < 128) return { value: i === 9 ? value - 2 ** 64 : value, end: at + 1 };
    }
    throw this.#corrupt('a number of more than ten bytes');
  }

  #corrupt(found: string): Error {
    return this.#bytes.fault('decode/corrupt', this.offset, 'a protobuf field of an ONNX model', found);
  }
}
