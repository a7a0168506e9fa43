import type { LoadBudget } from '../budget.js';
import { grouped, viewOf } from '../bytes.js';
import type { JsonSource } from '../json.js';
import { fail } from './layer.js';
import { unpackIntegers, type PackedBytes } from './packed.js';

/** The bytes of a binary layer (`.usdc`), with checks of all places. Numbers are little-endian. */
export class CrateBytes {
  readonly bytes: Uint8Array;
  readonly view: DataView;
  readonly name: string;
  readonly budget: LoadBudget;

  constructor({ bytes, name, budget }: JsonSource) {
    this.bytes = bytes;
    this.view = viewOf(bytes);
    this.name = name;
    this.budget = budget;
  }

  /** Charges bytes before they are allocated. */
  take(bytes: number): void {
    this.budget.take(bytes, this.name);
  }

  /** Throws `decode/truncated` if a range exceeds the file. */
  need(at: number, length: number): void {
    if (at >= 0 && length >= 0 && at + length <= this.bytes.length) return;
    const where = `${this.name}, byte ${grouped(this.bytes.length)} (end of the file)`;
    fail(where, `${grouped(length)} bytes at byte ${grouped(at)}`, 'fewer', true);
  }

  u32(at: number): number {
    this.need(at, 4);
    return this.view.getUint32(at, true);
  }

  u64(at: number): number {
    this.need(at, 8);
    return Number(this.view.getBigUint64(at, true));
  }

  slice(at: number, length: number): Uint8Array {
    this.need(at, length);
    return this.bytes.subarray(at, at + length);
  }

  /** Compressed bytes at `at`, after their length in 8 bytes; and the place behind them. */
  packed(at: number): { packed: PackedBytes; end: number } {
    const length = this.u64(at);
    const where = `${this.name}, byte ${grouped(at)}`;
    return { packed: { bytes: this.slice(at + 8, length), where, budget: this.budget }, end: at + 8 + length };
  }

  /** Unpacks `count` integers at `at`; `end` is the place behind them. */
  integers(at: number, count: number): { integers: Int32Array; end: number } {
    const { packed, end } = this.packed(at);
    return { integers: unpackIntegers(packed, count), end };
  }

  fault(at: number, expected: string, found: string): never {
    return fail(`${this.name}, byte ${grouped(at)}`, expected, found);
  }
}
