import { loadModule } from '@gaussian-splat/core';
import { alignedTo4, grouped, hostIsLittleEndian } from '../bytes.js';
import { checkedPart } from '../foreign-signatures.js';
import type { LoadBudget } from '../budget.js';
import { damaged } from '../faults.js';
import type { OpenFile, SceneSource, SplatRange } from '../scene-format.js';
import { isObject, show } from '../json.js';
import type { GltfFile, Json } from './container.js';
import { packingOf } from './meshopt-view.js';

/** A component type of accessors. `max` is the integer that represents 1 in normalized accessors. */
interface Component {
  readonly bytes: number;
  readonly max: number;
  readonly get: (view: DataView, at: number) => number;
}

/** Component types of glTF, by their numbers. */
export const COMPONENTS: ReadonlyMap<unknown, Component> = new Map([
  [5120, { bytes: 1, max: 127, get: (view: DataView, at: number) => view.getInt8(at) }],
  [5121, { bytes: 1, max: 255, get: (view: DataView, at: number) => view.getUint8(at) }],
  [5122, { bytes: 2, max: 32_767, get: (view: DataView, at: number) => view.getInt16(at, true) }],
  [5123, { bytes: 2, max: 65_535, get: (view: DataView, at: number) => view.getUint16(at, true) }],
  [5125, { bytes: 4, max: 4_294_967_295, get: (view: DataView, at: number) => view.getUint32(at, true) }],
  [5126, { bytes: 4, max: 1, get: (view: DataView, at: number) => view.getFloat32(at, true) }],
]);
const FLOAT = 5126;
const WIDTHS: ReadonlyMap<unknown, number> = new Map([
  ['SCALAR', 1],
  ['VEC2', 2],
  ['VEC3', 3],
  ['VEC4', 4],
]);

/** Values that {@link GltfDocument.readAccessor} reads. */
export interface AccessorData {
  /** Number of all elements of the accessor, including those outside the requested range. */
  readonly count: number;
  /** Count of numbers in each element, 1 to 4. */
  readonly width: number;
  /** [requested elements, width], normalized if the accessor requires it. Do not modify: it may be memory of the file. */
  readonly values: Float32Array;
}

/** Fetches a file by its URI in a glTF, which may be relative or absolute. */
export type OpenUri = (uri: string) => Promise<Uint8Array>;

/** Access to the objects of a glTF file by index, with validation. */
export class GltfDocument {
  readonly json: Json;
  readonly name: string;
  readonly budget: LoadBudget;
  readonly #binary: Uint8Array | undefined;
  readonly #open: OpenFile | undefined;
  readonly #openUri: OpenUri | undefined;
  readonly #buffers = new Map<number, Promise<Uint8Array>>();
  readonly #unpacked = new Map<unknown, Promise<Uint8Array>>();
  /** Files by URI, so that a file of several buffers is fetched once. */
  readonly #files = new Map<string, Promise<Uint8Array>>();

  /**
   * @param open Opens other files of the scene. `part` opens a file by its path relative to the glTF, `uri` any file by
   * its URI.
   */
  constructor(
    { json, binary }: GltfFile,
    { name, budget }: Pick<SceneSource, 'name' | 'budget'>,
    open: { readonly part: OpenFile } | { readonly uri: OpenUri },
  ) {
    this.json = json;
    this.name = name;
    this.budget = budget;
    this.#binary = binary;
    this.#open = 'part' in open ? open.part : undefined;
    this.#openUri = 'uri' in open ? open.uri : undefined;
  }

  /** Throws `decode/header` for a property. @param path Path of the property in the JSON. */
  fail(path: string, expected: string, found: unknown): never {
    throw damaged(`${this.name}, ${path}`, expected, show(found), 'decode/header');
  }

  /** Charges bytes to the budget before they are allocated. Throws `out-of-memory/budget`. */
  take(bytes: number): void {
    this.budget.take(bytes, this.name);
  }

  /** Returns element `index` of a top-level array, such as `nodes`. Throws `decode/header` if it is not an object. */
  item(list: string, index: unknown): Json {
    const array = this.json[list];
    const found: unknown = Array.isArray(array) && this.isIndex(index) ? array[index] : undefined;
    return isObject(found) ? found : this.fail(`${list}[${String(index)}]`, 'an object', found);
  }

  /** Whether meshoptimizer has compressed any buffer view. */
  get hasPackedViews(): boolean {
    const { bufferViews } = this.json;
    return Array.isArray(bufferViews) && bufferViews.some((view: unknown) => isObject(view) && packingOf(view));
  }

  /** Whether any buffer is in another file. */
  get hasFilesBeside(): boolean {
    const { buffers } = this.json;
    return Array.isArray(buffers) && buffers.some((buffer: unknown) => isObject(buffer) && isFile(buffer.uri));
  }

  isIndex(value: unknown): value is number {
    return Number.isSafeInteger(value) && (value as number) >= 0;
  }

  /** Returns the declared number of elements of an accessor. Only {@link readAccessor} checks that the file has them. */
  accessorCount(index: unknown): number {
    const { count } = this.item('accessors', index);
    return this.isIndex(count) ? count : this.fail(`accessors[${String(index)}].count`, 'a whole number', count);
  }

  /**
   * Reads elements of an accessor as float32, with its sparse values, and normalized if the accessor is.
   * @param range Range of elements to read; default all.
   * @param maxZeros Maximum number of elements of a sparse accessor without a buffer view, whose other values are 0.
   * @throws GaussianSplatError `decode/header`, `decode/corrupt`, `decode/truncated`, `decode/unsupported`,
   * `out-of-memory/budget`; errors of opening another file
   */
  async readAccessor(index: unknown, range?: SplatRange, maxZeros = 0): Promise<AccessorData> {
    const accessor = this.item('accessors', index);
    const path = `accessors[${String(index)}]`;
    const component =
      COMPONENTS.get(accessor.componentType) ??
      this.fail(`${path}.componentType`, '5120 to 5126', accessor.componentType);
    const width = WIDTHS.get(accessor.type) ?? this.fail(`${path}.type`, 'SCALAR to VEC4', accessor.type);
    const count = this.accessorCount(index);
    const { first, end } = range ?? { first: 0, end: count };
    const own = { first, end: Math.max(first, Math.min(count, end)) };
    const { sparse, componentType, normalized } = accessor;
    const isSparse = sparse !== undefined;
    const values =
      accessor.bufferView === undefined
        ? this.#zeros(path, isSparse && count <= maxZeros ? width * (own.end - own.first) : undefined)
        : await this.#readDense(accessor, path, count, width, component, own);
    let whole = values;
    if (isSparse) {
      // Sparse values are written to a copy, because `values` may be memory of the file.
      this.take(values.byteLength);
      whole = values.slice();
      const { putSparse } = await loadModule('the code that reads sparse accessors', () => import('./sparse.js'));
      await putSparse(this, sparse, { path, componentType, count, range: own, width, values: whole });
    }
    // Normalization maps the two lowest signed integers to -1, for example -128 and -127.
    if (normalized === true && componentType !== FLOAT) normalize(whole, component.max);
    return { count, width, values: whole };
  }

  /**
   * Returns `length` zeros for a sparse accessor without a buffer view. Throws `decode/unsupported` if `length` is
   * undefined: the accessor is not sparse, or has more elements than `maxZeros`.
   */
  #zeros(path: string, length: number | undefined): Float32Array {
    if (length !== undefined) {
      this.take(4 * length);
      return new Float32Array(length);
    }
    const expected = 'an accessor whose numbers lie in a buffer';
    throw damaged(`${this.name}, ${path}`, expected, 'one without "bufferView"', 'decode/unsupported');
  }

  /** Returns a range of elements as float32, not normalized. The array may be memory of the file. */
  async #readDense(
    accessor: Json,
    path: string,
    count: number,
    width: number,
    component: Component,
    { first, end: last }: SplatRange,
  ): Promise<Float32Array> {
    const view = this.item('bufferViews', accessor.bufferView);
    const bytes = await this.readView(accessor.bufferView);
    const { byteOffset = 0 } = accessor;
    const { byteStride = width * component.bytes } = view;
    const isStride = this.isIndex(byteStride) && byteStride >= width * component.bytes && byteStride <= 252;
    if (!this.isIndex(byteOffset) || !isStride) {
      return this.fail(path, 'an offset and a stride that fit', { byteOffset, byteStride });
    }
    const end = count === 0 ? 0 : byteOffset + (count - 1) * byteStride + width * component.bytes;
    if (end > bytes.length) {
      throw damaged(`${this.name}, ${path}`, `${grouped(end)} bytes`, grouped(bytes.length), 'decode/corrupt');
    }
    const elements = last - first;
    this.take(4 * elements * width);
    const start = byteOffset + first * byteStride;
    if (accessor.componentType === FLOAT && byteStride === 4 * width && hostIsLittleEndian) {
      // Contiguous float32 are not copied, unless their offset in memory is no multiple of 4.
      const own = alignedTo4(bytes.subarray(start, start + 4 * elements * width));
      return new Float32Array(own.buffer, own.byteOffset, elements * width);
    }
    const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const values = new Float32Array(elements * width);
    for (let i = 0; i < elements; i++) {
      const at = start + i * byteStride;
      for (let k = 0; k < width; k++) values[i * width + k] = component.get(data, at + k * component.bytes);
    }
    return values;
  }

  /** Returns the bytes of a buffer view, by its index. Views that meshoptimizer has compressed are decompressed once. */
  async readView(index: unknown): Promise<Uint8Array> {
    const view = this.item('bufferViews', index);
    const path = `bufferViews[${String(index)}]`;
    const packed = packingOf(view);
    if (packed === undefined) return this.readRange(view, path);
    const unpacking = this.#unpacked.get(index) ?? this.#unpack(packed, path);
    this.#unpacked.set(index, unpacking);
    return unpacking;
  }

  async #unpack(packed: Json, path: string): Promise<Uint8Array> {
    const { unpackView } = await loadModule('the code that decodes meshopt', () => import('./unpack-view.js'));
    return unpackView(this, packed, path);
  }

  /**
   * Returns the bytes of a range of a buffer.
   * @param path Path of the range's object in the JSON, for error messages.
   */
  async readRange({ buffer, byteOffset = 0, byteLength }: Json, path: string): Promise<Uint8Array> {
    if (!this.isIndex(buffer) || !this.isIndex(byteOffset) || !this.isIndex(byteLength)) {
      return this.fail(path, 'a buffer, an offset and a length', { buffer, byteOffset, byteLength });
    }
    const loading = this.#buffers.get(buffer) ?? this.#loadBuffer(buffer);
    this.#buffers.set(buffer, loading);
    const bytes = await loading;
    if (byteOffset + byteLength > bytes.length) {
      throw damaged(
        `${this.name}, ${path}`,
        `${grouped(byteOffset + byteLength)} bytes`,
        grouped(bytes.length),
        'decode/truncated',
      );
    }
    return bytes.subarray(byteOffset, byteOffset + byteLength);
  }

  /**
   * Replaces the content of an accessor by decoded bytes: adds a buffer and a buffer view to the JSON.
   * @param stride Bytes from the beginning of an element to the next; undefined for packed elements.
   */
  provide(accessor: number, bytes: Uint8Array, stride?: number): void {
    const { json } = this;
    const bufferViews = Array.isArray(json.bufferViews) ? (json.bufferViews as unknown[]) : [];
    const buffers = Array.isArray(json.buffers) ? (json.buffers as unknown[]) : [];
    json.bufferViews = bufferViews;
    json.buffers = buffers;
    this.#buffers.set(buffers.length, Promise.resolve(bytes));
    Object.assign(this.item('accessors', accessor), { bufferView: bufferViews.length, byteOffset: 0 });
    bufferViews.push({ buffer: buffers.length, byteLength: bytes.length, byteStride: stride });
    buffers.push({ byteLength: bytes.length });
  }

  async #loadBuffer(index: number): Promise<Uint8Array> {
    const { uri } = this.item('buffers', index);
    if (uri === undefined) {
      if (index === 0 && this.#binary) return this.#binary;
      return this.fail(`buffers[${index}]`, 'an address, or the binary chunk of a GLB', uri);
    }
    return this.readUri(uri, `buffers[${index}].uri`);
  }

  /**
   * Returns the bytes of a URI, which may be a data URL. Each file is fetched once.
   * @param path Path of the URI in the JSON, for error messages.
   */
  async readUri(uri: unknown, path: string): Promise<Uint8Array> {
    if (typeof uri !== 'string') return this.fail(path, 'an address', uri);
    if (/^data:/i.test(uri)) return this.#decodeDataUri(uri, path);
    if (!this.#openUri && /^([a-z][a-z0-9+.-]*:|\/\/)/i.test(uri)) {
      const expected = 'a relative address: a file beside the scene, or "data:"';
      throw damaged(`${this.name}, ${path}`, expected, show(uri), 'decode/unsupported');
    }
    // The query is separate from the path, because only servers need it.
    const [, file, query] = /^([^?#]*)(\?[^#]*)?/.exec(uri)!;
    const found = this.#files.get(uri) ?? this.#openUri?.(uri) ?? this.#open!(decodeSafely(file), query);
    this.#files.set(uri, found);
    return checkedPart(await found, `${this.name}, ${decodeSafely(file).slice(0, 200)}`);
  }

  #decodeDataUri(uri: string, path: string): Uint8Array {
    const match = /^data:[^,]*;base64,/i.exec(uri.slice(0, 200));
    try {
      if (match) return bytesOf(atob(uri.slice(match[0].length)));
    } catch {
      // The error is thrown below.
    }
    return this.fail(path, 'base64', uri.slice(0, 40));
  }
}

/** Converts characters 0..255 to bytes. A loop is 25 times as fast as `Uint8Array.from` with a function. */
function bytesOf(text: string): Uint8Array {
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function normalize(values: Float32Array, max: number): void {
  for (let i = 0; i < values.length; i++) values[i] = Math.max(-1, values[i] / max);
}

const isFile = (uri: unknown): boolean => typeof uri === 'string' && !/^data:/i.test(uri);

function decodeSafely(uri: string): string {
  try {
    return decodeURIComponent(uri);
  } catch {
    return uri;
  }
}
