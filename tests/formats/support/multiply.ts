/**
 * A hostile generator for every format: finds the parts of a file (archives, gzip, JSON, headers of text, chunks), and
 * multiplies counts, sizes, lists, names and nesting in one of them. The containers around it stay sound, so that
 * readers come to the part.
 */
import { gunzipSync, gzipSync, unzipSync, zipSync } from 'fflate';
import type { Random } from '../../support/random.js';
import { damage } from './damage.js';

/** Maximum size of a multiplied part in bytes. */
const MAX_BYTES = 200_000;
const NUMBERS = [0, -1, 0.5, 2, 64, 255, 4096, 65_535, 1e6, 1e7, 2 ** 28, 2 ** 31, 2 ** 32, 2 ** 53, 1e-300, 1e300];
const ODD: readonly unknown[] = [
  null,
  true,
  '',
  'ADD',
  [],
  {},
  { toString: 1 },
  [[]],
  '../../x',
  'http://other.example/x',
];

type Json = Record<string, unknown>;

class Multiplier {
  readonly #random: Random;
  /** Values that are multiplied already. Changes within them would multiply with their copies. */
  readonly #grown = new WeakSet<object>();

  constructor(random: Random) {
    this.#random = random;
  }

  below(n: number): number {
    return Math.floor(this.#random.uniform(0, n));
  }

  pick<T>(values: readonly T[]): T {
    return values[this.below(values.length)];
  }

  /** A factor of 2 to 100,000, as often small as large. */
  factor(max = 1e5): number {
    return Math.floor(this.#random.logUniform(2, Math.max(3, max)));
  }

  file(bytes: Uint8Array): Uint8Array {
    const start = Buffer.from(bytes.subarray(0, 4)).toString('latin1');
    try {
      if (start.startsWith('\x1f\x8b')) return Buffer.from(gzipSync(this.file(gunzipSync(bytes)), { mtime: 0 }));
      if (start.startsWith('PK')) return this.#archive(bytes);
      if (start === 'glTF') return this.#glb(bytes);
      if (start === 'GSV\n') return this.#headed(bytes, 8, 12, 1);
      if (start.startsWith('RAD')) return this.#headed(bytes, 4, 8, 8);
      if (/^\s*\{/.test(start)) return this.#text(bytes);
      if (start.startsWith('ply')) return this.#ply(bytes);
    } catch {
      // A part that is damaged already.
    }
    return this.#binary(bytes);
  }

  #archive(bytes: Uint8Array): Uint8Array {
    const files = unzipSync(bytes);
    const names = Object.keys(files);
    const name = this.pick(names);
    if (this.below(8) === 0) {
      const count = Math.min(this.factor(2_000), MAX_BYTES / (1 + files[name].length));
      for (let k = 0; k < count; k++) files[`${k}/${name}`] = files[name];
    } else files[name] = new Uint8Array(this.file(files[name]));
    return zipSync(files, { level: this.pick([0, 9]) });
  }

  /** A head of 12 bytes with the length of the file, a chunk of JSON and one of numbers, each with its length and type. */
  #glb(bytes: Uint8Array): Uint8Array {
    const end = 20 + new DataView(bytes.buffer, bytes.byteOffset).getUint32(12, true);
    const rest = bytes.subarray(end);
    if (this.below(4) === 0) return Buffer.concat([bytes.subarray(0, end), this.#binary(rest)]);
    const text = padded(this.#text(bytes.subarray(20, end)), 4);
    const head = Buffer.from(bytes.subarray(0, 20));
    head.writeUInt32LE(20 + text.length + rest.length, 8);
    head.writeUInt32LE(text.length, 12);
    return Buffer.concat([head, text, rest]);
  }

  /** A length, JSON of that length, and more bytes. */
  #headed(bytes: Uint8Array, lengthAt: number, start: number, unit: number): Uint8Array {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const length = lengthAt < 0 ? bytes.indexOf(10) : view.getUint32(lengthAt, true);
    const end = start + unit * Math.ceil(length / unit);
    const rest = bytes.subarray(end);
    if (this.below(4) === 0) return Buffer.concat([bytes.subarray(0, end), this.#binary(rest)]);
    const text = this.#text(bytes.subarray(start, start + length));
    const head = Buffer.from(bytes.subarray(0, start));
    if (lengthAt >= 0) head.writeUInt32LE(text.length, lengthAt);
    return Buffer.concat([head, padded(text, unit), rest]);
  }

  #text(bytes: Uint8Array): Uint8Array {
    const text = Buffer.from(bytes).toString();
    const newline = text.indexOf('\n');
    // The description of a floor is a line before its heights.
    if (
      newline > 0 &&
      !text
        .slice(newline)
        .trimStart()
        .match(/^["[{}\]]/)
    )
      return this.#headed(bytes, -1, 0, 1);
    const root = JSON.parse(text) as Json;
    for (let changes = 1 + this.below(3); changes > 0; changes--) this.#change(root);
    const changed = JSON.stringify(root);
    return Buffer.from(changed.length <= 4 * MAX_BYTES ? changed : text);
  }

  /** Multiplies one value of a JSON tree. */
  #change(root: Json): void {
    let node = root as Record<string, unknown> | unknown[];
    for (;;) {
      const keys = Object.keys(node);
      if (keys.length === 0) return;
      const key = this.pick(keys) as keyof typeof node;
      const value = node[key] as unknown;
      const isTree = typeof value === 'object' && value !== null && !this.#grown.has(value);
      if (isTree && this.below(4) > 0) {
        node = value as Json;
        continue;
      }
      const changed = this.below(6) === 0 ? this.pick(ODD) : this.#multiplied(value);
      if (typeof changed === 'object' && changed !== null) this.#grown.add(changed);
      (node as Json)[key] = changed;
      return;
    }
  }

  #multiplied(value: unknown): unknown {
    if (typeof value === 'number') return this.below(3) === 0 ? value * this.factor() : this.pick(NUMBERS);
    if (typeof value === 'string') {
      const all = ['{0}', '{level}{x}{y}', '../', 'a/', 'a', value];
      const one = this.pick(all);
      return one.repeat(Math.min(this.factor(), Math.ceil(MAX_BYTES / (1 + one.length)))) + value;
    }
    if (typeof value !== 'object' || value === null) return this.pick(NUMBERS);
    const size = JSON.stringify(value).length;
    const count = Math.min(this.factor(), Math.ceil(MAX_BYTES / (1 + size)));
    if (Array.isArray(value)) {
      if (this.below(4) === 0) return this.#nested(value, count);
      const own: unknown = value.length > 0 ? this.pick(value) : 0;
      const bytes = JSON.stringify(own)?.length ?? 1;
      const more = Math.min(this.factor(), Math.ceil(MAX_BYTES / (1 + bytes)));
      return [...(value as unknown[]), ...Array.from({ length: more }, () => own)];
    }
    return this.#nested(value as Json, count);
  }

  /** A value within copies of itself: in its own list if it has one, as children of tiles and nodes of trees. */
  #nested(value: Json | unknown[], count: number): unknown {
    const depth = Math.min(count, 2_000);
    if (Array.isArray(value)) return Array.from({ length: depth }).reduce<unknown>((inner) => [inner], value);
    const list = Object.keys(value).find((key) => Array.isArray(value[key])) ?? 'children';
    return Array.from({ length: depth }).reduce<unknown>((inner) => ({ ...value, [list]: [inner] }), value);
  }

  /** Lines of a header: repeated, with other numbers, with long names. */
  #ply(bytes: Uint8Array): Uint8Array {
    const end = Buffer.from(bytes).indexOf('end_header');
    if (end < 0) return this.#binary(bytes);
    const lines = Buffer.from(bytes.subarray(0, end)).toString('latin1').trimEnd().split('\n');
    const at = 1 + this.below(lines.length - 1);
    const [line] = lines.slice(at, at + 1);
    const count = Math.min(this.factor(), MAX_BYTES / (1 + line.length));
    const change = this.below(4);
    if (change === 0) lines.splice(at, 0, ...Array.from({ length: count }, (_, k) => (k % 2 ? line : `${line}${k}`)));
    else if (change === 1) lines[at] = line.replace(/\d+/, () => String(Math.abs(this.pick(NUMBERS))));
    else if (change === 2) lines[at] = line + 'a'.repeat(count);
    else
      lines[at] = line.replace(/(float|uchar|uint|int|double) /, () =>
        this.pick(['list uchar int ', 'double ', 'uchar ']),
      );
    return Buffer.concat([Buffer.from(`${lines.join('\n')}\n`, 'latin1'), bytes.subarray(end)]);
  }

  /** Words of a binary file become other numbers; stretches are repeated. */
  #binary(bytes: Uint8Array): Uint8Array {
    if (bytes.length < 8 || this.below(3) === 0) return damage(bytes, this.#random);
    const changed = Buffer.from(bytes);
    const at = this.below(this.below(2) === 0 ? Math.min(256, bytes.length - 8) : bytes.length - 8);
    if (this.below(3) === 0) {
      const stretch = changed.subarray(at, at + 1 + this.below(64));
      const count = Math.min(this.factor(), Math.ceil(MAX_BYTES / stretch.length));
      return Buffer.concat([changed.subarray(0, at), ...Array<Buffer>(count).fill(stretch), changed.subarray(at)]);
    }
    const number = this.pick(NUMBERS);
    for (let changes = 1 + this.below(3); changes > 0; changes--) {
      const place = Math.min(bytes.length - 8, at + 4 * this.below(4));
      const whole = Math.min(2 ** 32 - 1, Math.abs(Math.trunc(number)));
      if (this.below(4) === 0) changed.writeFloatLE(number, place);
      else if (this.below(2) === 0) changed.writeUInt32LE(whole, place);
      else changed.writeUInt16LE(whole % 65_536, place);
    }
    return changed;
  }
}

const padded = (bytes: Uint8Array, unit: number): Uint8Array =>
  Buffer.concat([bytes, Buffer.alloc((unit - (bytes.length % unit)) % unit, 32)]);

/** A file with one of its parts multiplied; the same for the same random numbers. */
export const multiply = (file: Uint8Array, random: Random): Uint8Array => new Multiplier(random).file(file);
