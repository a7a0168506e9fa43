import { loadModule } from '@gaussian-splat/core';
import { alignedTo4, grouped, hostIsLittleEndian } from '../bytes.js';
import { checkedPart } from '../foreign-signatures.js';
import type { LoadBudget } from '../budget.js';
import { damaged } from '../faults.js';
import type { OpenFile, SceneSource, SplatRange } from '../scene-format.js';
import { isObject, show } from '../json.js';
import type { GltfFile, Json } from './container.js';

/** A component type: its size in bytes, its maximum, and its getter. */
interface Component {
  readonly bytes: number;
  readonly max: number;
  readonly get: (view: DataView, at: number) => number;
}

/** Component types of glTF. */
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

/** Numbers of an accessor. */
export interface AccessorData {
  /** Total number of elements of the accessor, including those outside the range. */
  readonly count: number;
  /** Numbers of one element. */
  readonly width: number;
  /** [requested elements, width], normalized if the accessor requires it. Read-only: it may be the file's own memory. */
  readonly values: Float32Array;
}

/** Fetches a file by its URI in a glTF, relative or absolute. */
export type OpenUri = (uri: string) => Promise<Uint8Array>;

/** Validated access to the parts of a glTF file by index. */
export class GltfDocument {
  readonly json: Json;
  readonly name: string;
  readonly budget: LoadBudget;
  readonly #binary: Uint8Array | undefined;
  readonly #open: OpenFile | undefined;
  readonly #openUri: OpenUri | undefined;
  readonly #buffers = new Map<number, Promise<Uint8Array>>();
  /** Each file is fetched once, even if several buffers name it. */
  readonly #files = new Map<string, Promise<Uint8Array>>();

  /** @param open Opens files relative to it by their paths, or any file by its address. */
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

  /** Throws `decode/header`. */
  fail(path: string, expected: string, found: unknown): never {
    throw damaged(`${this.name}, ${path}`, expected, show(found), 'decode/header');
  }

  /** Charges bytes before they are allocated. Throws `out-of-memory/budget`. */
  take(bytes: number): void {
    this.budget.take(bytes, this.name);
  }

  /** Element `index` of an array of objects at the top level of the file. */
  item(list: string, index: unknown): Json {
    const array = this.json[list];
    const found: unknown = Array.isArray(array) && this.isIndex(index) ? array[index] : undefined;
    return isObject(found) ? found : this.fail(`${list}[${String(index)}]`, 'an object', found);
  }

  /** Whether a buffer is another file. */
  get hasFilesBeside(): boolean {
    const { buffers } = this.json;
    return Array.isArray(buffers) && buffers.some((buffer: unknown) => isObject(buffer) && isFile(buffer.uri));
  }

  isIndex(value: unknown): value is number {
    return Number.isSafeInteger(value) && (value as number) >= 0;
  }

  /** Declared number of elements of an accessor; its size in bytes is checked when it is read. */
  accessorCount(index: unknown): number {
    const { count } = this.item('accessors', index);
    return this.isIndex(count) ? count : this.fail(`accessors[${String(index)}].count`, 'a whole number', count);
  }

  /**
   * @param range Elements to read; default all.
   * @param maxZeros Maximum number of elements of a sparse accessor without a buffer: they are zeros.
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
      // They may be the file's own memory.
      this.take(values.byteLength);
      whole = values.slice();
      const { putSparse } = await loadModule('the code that reads sparse accessors', () => import('./sparse.js'));
      await putSparse(this, sparse, { path, componentType, count, range: own, width, values: whole });
    }
    // The lowest signed integer means -1, as does the one above it.
    if (normalized === true && componentType !== FLOAT) normalise(whole, component.max);
    return { count, width, values: whole };
  }

  /** Without a view and without sparse data, an extension must provide the numbers. */
  #zeros(path: string, length: number | undefined): Float32Array {
    if (length !== undefined) {
      this.take(4 * length);
      return new Float32Array(length);
    }
    const expected = 'an accessor whose numbers lie in a buffer';
    throw damaged(`${this.name}, ${path}`, expected, 'one without "bufferView"', 'decode/unsupported');
  }

  /** Reads numbers as stored. */
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
      // Numbers in the required layout share the file's memory. The start of a view need not be a multiple of 4.
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

  /** The bytes of a buffer view. */
  async readView(index: unknown): Promise<Uint8Array> {
    return this.readRange(this.item('bufferViews', index), `bufferViews[${String(index)}]`);
  }

  /** The bytes of a range of a buffer. */
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
   * Gives an accessor a buffer of its own, with a buffer view, as a decoder of an extension does.
   * @param stride Bytes from one element to the next; undefined for packed elements.
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

  /** The bytes at a URI of the file; each URI is fetched once. */
  async readUri(uri: unknown, path: string): Promise<Uint8Array> {
    if (typeof uri !== 'string') return this.fail(path, 'an address', uri);
    if (/^data:/i.test(uri)) return this.#decodeDataUri(uri, path);
    if (!this.#openUri && /^([a-z][a-z0-9+.-]*:|\/\/)/i.test(uri)) {
      const expected = 'a relative address: a file beside the scene, or "data:"';
      throw damaged(`${this.name}, ${path}`, expected, show(uri), 'decode/unsupported');
    }
    // A query after the path is for servers; a local file is found without it.
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
      // Said below.
    }
    return this.fail(path, 'base64', uri.slice(0, 40));
  }
}

/** Converts characters to bytes in a loop, which is 25 times as fast as `Uint8Array.from` with a function. */
function bytesOf(text: string): Uint8Array {
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function normalise(values: Float32Array, max: number): void {
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
