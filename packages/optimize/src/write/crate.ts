/** Writes binary layers of OpenUSD (`.usdc`, version 0.8). Arrays are stored as they are, the structure as literals of LZ4. */
import { concatenated } from '@gaussian-splat/core/fetch';
import { fileBytes } from './file-bytes.js';

/** Numbers of the type and width of an element of an array. */
export type CrateArray = Float32Array | Uint16Array;

/** Value of a field. Arrays of numbers have a type of {@link TYPES}. */
export type CrateValue =
  | { readonly token: string }
  | { readonly tokens: readonly string[]; readonly isArray?: boolean }
  | { readonly double: number }
  | { readonly strings: Readonly<Record<string, string>> }
  | { readonly int: number }
  | { readonly doubles: readonly [number, number, number] }
  | { readonly specifier: 0 }
  | { readonly isUniform: true }
  | { readonly array: CrateArray; readonly type: CrateType; readonly width: number };

/** Types of elements of arrays by their names in text; the halves have 16 bits. */
const TYPES = {
  float: 8,
  half: 7,
  float3: 24,
  half3: 25,
  point3f: 24,
  quatf: 17,
  quath: 18,
} as const;
export type CrateType = keyof typeof TYPES;

const [STRING, DICTIONARY] = [10, 31];
const [TOKEN, INT, DOUBLE, VECTOR_3D, TOKEN_VECTOR, SPECIFIER, VARIABILITY] = [11, 3, 9, 23, 41, 42, 44];
const [IS_ARRAY, IS_INLINE] = [0x80000000, 0x40000000];
/** Kinds of specs. */
const [ATTRIBUTE, PRIM, ROOT] = [1, 6, 7];
const [HEADER_BYTES, VERSION, ALIGNMENT] = [88, 8, 8];

export type CrateFields = Readonly<Record<string, CrateValue>>;

/** A layer with one prim at its root. */
export interface CratePrim {
  readonly name: string;
  readonly fields: CrateFields;
  /** Fields of its attributes by name. */
  readonly attributes: Readonly<Record<string, CrateFields>>;
}

/**
 * Returns the bytes of a layer with one prim.
 * @throws GaussianSplatError `out-of-memory/allocation`
 */
export function writeCrate(layer: CrateFields, { name, fields, attributes }: CratePrim): Uint8Array<ArrayBuffer> {
  const names = Object.keys(attributes);
  const specs = [
    { kind: ROOT, fields: { ...layer, primChildren: { tokens: [name] } } },
    { kind: PRIM, fields: { ...fields, properties: { tokens: names } } },
    ...names.map((own) => ({ kind: ATTRIBUTE, fields: attributes[own] })),
  ];
  const parts = new Parts();
  // Index 0 cannot be the name of a property, whose index is stored as a negative number.
  parts.tokenOf('');
  const reps: { token: number; low: number; high: number }[] = [];
  const sets: number[] = [];
  const starts = specs.map((spec) => {
    const start = sets.length;
    for (const [field, value] of Object.entries<CrateValue>(spec.fields)) {
      sets.push(reps.length);
      reps.push({ token: parts.tokenOf(field), ...parts.repOf(value) });
    }
    sets.push(-1);
    return start;
  });
  const order = specs.map((_, k) => k);
  const elements = [0, parts.tokenOf(name), ...names.map((own) => -parts.tokenOf(own))];
  // The root and the prim have a child alone (-1), each attribute a sibling alone (0), the last one neither (-2).
  const jumps = [-1, names.length > 0 ? -1 : -2, ...names.map((_, k) => (k < names.length - 1 ? 0 : -2))];
  const sections: readonly (readonly [string, readonly Uint8Array[]])[] = [
    ['TOKENS', tokenSection(parts.tokens)],
    ['STRINGS', [u64(parts.strings.length), bytesOf(parts.strings)]],
    [
      'FIELDS',
      [
        u64(reps.length),
        ...integers(reps.map(({ token }) => token)),
        ...sized(literal(bytesOf(reps.flatMap(({ low, high }) => [low, high])))),
      ],
    ],
    ['FIELDSETS', [u64(sets.length), ...integers(sets)]],
    ['PATHS', [u64(order.length), u64(order.length), ...integers(order), ...integers(elements), ...integers(jumps)]],
    ['SPECS', [u64(order.length), ...integers(order), ...integers(starts), ...integers(specs.map(({ kind }) => kind))]],
  ];
  return assembled(parts, sections);
}

/** Values before the sections of a layer, with their places in the file, and its tokens. */
class Parts {
  readonly tokens: string[] = [];
  /** Index of the token of each string. */
  readonly strings: number[] = [];
  readonly values: { readonly at: number; readonly bytes: Uint8Array }[] = [];
  end = HEADER_BYTES;
  readonly #known = new Map<string, number>();

  tokenOf(text: string): number {
    const known = this.#known.get(text) ?? this.tokens.length;
    if (known === this.tokens.length) this.tokens.push(text);
    this.#known.set(text, known);
    return known;
  }

  /** Returns the stored form of a value. Adds its bytes unless they fit into it. */
  repOf(value: CrateValue): { low: number; high: number } {
    const inline = (type: number, low: number): { low: number; high: number } => ({
      low,
      high: IS_INLINE + (type << 16),
    });
    if ('token' in value) return inline(TOKEN, this.tokenOf(value.token));
    if ('int' in value) return inline(INT, value.int);
    if ('specifier' in value) return inline(SPECIFIER, value.specifier);
    if ('isUniform' in value) return inline(VARIABILITY, 1);
    if ('doubles' in value) return this.#add(VECTOR_3D << 16, [bytesIn(Float64Array.from(value.doubles))]);
    if ('strings' in value) {
      const entries = Object.entries(value.strings);
      // The distance of 8 bytes to each value is that of its own size.
      const rows = entries.flatMap(([key, text]) => {
        const { low, high } = inline(STRING, this.#stringOf(text));
        return [this.#stringOf(key), 8, 0, low, high];
      });
      return this.#add(DICTIONARY << 16, [u64(entries.length), bytesOf(rows)]);
    }
    if ('double' in value) return this.#doubleOf(value.double, inline);
    if ('tokens' in value) {
      const indices = bytesOf(value.tokens.map((token) => this.tokenOf(token)));
      const type = value.isArray ? IS_ARRAY + (TOKEN << 16) : TOKEN_VECTOR << 16;
      return this.#add(type, [u64(value.tokens.length), indices]);
    }
    const { array, type, width } = value;
    return this.#add(IS_ARRAY + (TYPES[type] << 16), [u64(array.length / width), bytesIn(array)]);
  }

  #stringOf(text: string): number {
    return this.strings.push(this.tokenOf(text)) - 1;
  }

  /** A double is stored as a float if that is exact. */
  #doubleOf(
    value: number,
    inline: (type: number, low: number) => { low: number; high: number },
  ): { low: number; high: number } {
    if (Math.fround(value) !== value) return this.#add(DOUBLE << 16, [bytesIn(Float64Array.of(value))]);
    return inline(DOUBLE, new Uint32Array(Float32Array.of(value).buffer)[0]);
  }

  #add(high: number, parts: readonly Uint8Array[]): { low: number; high: number } {
    this.end += -this.end & (ALIGNMENT - 1);
    const start = this.end;
    for (const bytes of parts) {
      this.values.push({ at: this.end, bytes });
      this.end += bytes.length;
    }
    return { low: start % 2 ** 32, high: high + Math.floor(start / 2 ** 32) };
  }
}

/** Returns the file: a header, the values, the sections, and their table. */
function assembled(
  parts: Parts,
  sections: readonly (readonly [string, readonly Uint8Array[]])[],
): Uint8Array<ArrayBuffer> {
  const sizeOf = (bytes: readonly Uint8Array[]): number => bytes.reduce((sum, { length }) => sum + length, 0);
  const tableAt = sections.reduce((at, [, bytes]) => at + sizeOf(bytes), parts.end);
  const file = fileBytes('OpenUSD', tableAt + 8 + 32 * sections.length);
  file.set(new TextEncoder().encode('PXR-USDC'));
  file[9] = VERSION;
  file.set(u64(tableAt), 16);
  for (const { at, bytes } of parts.values) file.set(bytes, at);
  file.set(u64(sections.length), tableAt);
  let at = parts.end;
  sections.forEach(([name, pieces], k) => {
    const entry = tableAt + 8 + 32 * k;
    file.set(new TextEncoder().encode(name), entry);
    file.set(u64(at), entry + 16);
    file.set(u64(sizeOf(pieces)), entry + 24);
    for (const bytes of pieces) {
      file.set(bytes, at);
      at += bytes.length;
    }
  });
  return file;
}

function tokenSection(tokens: readonly string[]): Uint8Array[] {
  const text = new TextEncoder().encode(tokens.map((token) => `${token}\0`).join(''));
  return [u64(tokens.length), u64(text.length), ...sized(literal(text))];
}

/** Returns integers as differences of 32 bits: the most common one, 0, the code 3 for each, and all of them. */
function integers(values: readonly number[]): Uint8Array[] {
  const codes = new Uint8Array(Math.ceil(values.length / 4)).fill(255);
  const differences = bytesOf(values.map((value, k) => value - (k > 0 ? values[k - 1] : 0)));
  return sized(literal(concatenated(Uint8Array, [new Uint8Array(4), codes, differences])));
}

/** Returns a block of LZ4 that contains bytes without compression, after a count of chunks of 0. */
function literal(bytes: Uint8Array): Uint8Array {
  const { length } = bytes;
  const extra =
    length < 15 ? [] : [...new Array<number>(Math.floor((length - 15) / 255)).fill(255), (length - 15) % 255];
  return concatenated(Uint8Array, [Uint8Array.of(0, Math.min(15, length) << 4, ...extra), bytes]);
}

const sized = (bytes: Uint8Array): Uint8Array[] => [u64(bytes.length), bytes];

const u64 = (value: number): Uint8Array => bytesIn(BigUint64Array.of(BigInt(value)));

const bytesOf = (values: readonly number[]): Uint8Array => bytesIn(Int32Array.from(values, (value) => value | 0));

const bytesIn = ({ buffer, byteOffset, byteLength }: ArrayBufferView): Uint8Array =>
  new Uint8Array(buffer, byteOffset, byteLength);
