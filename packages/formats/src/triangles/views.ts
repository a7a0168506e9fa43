import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject } from '../json.js';
import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { meshoptParameters, packingOf } from '../gltf/meshopt-view.js';
import { layoutOf } from './costs.js';
import type { Survey } from './survey.js';

/** Bytes of an index of a sparse accessor, by component type. */
const INDEX_BYTES: ReadonlyMap<unknown, number> = new Map([
  [5121, 1],
  [5123, 2],
  [5125, 4],
]);

/** Buffer views of the accessors that a scene uses. The constructor validates the ranges of these accessors. */
export class Views {
  /** GPU memory of the accessors in bytes. */
  readonly byteLength: number;
  readonly #document: GltfDocument;
  readonly #used = new Set<number>();

  /** Validates the ranges of all used accessors. Throws `decode/*`. */
  constructor(document: GltfDocument, { accessors }: Survey) {
    this.#document = document;
    let bytes = 0;
    for (const index of accessors) bytes += this.#check(index);
    this.byteLength = bytes;
  }

  /**
   * Copies the used buffer views from their buffers. Compressed ones are decompressed.
   * @returns One entry for each buffer view of the file; undefined for unused ones.
   * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`; errors of fetching buffers
   */
  async read(): Promise<(Uint8Array<ArrayBuffer> | undefined)[]> {
    const { bufferViews } = this.#document.json;
    const length = Array.isArray(bufferViews) ? bufferViews.length : 0;
    const views = new Array<Uint8Array<ArrayBuffer> | undefined>(length).fill(undefined);
    for (const index of this.#used) views[index] = await this.#copyOf(index);
    return views;
  }

  async #copyOf(index: number): Promise<Uint8Array<ArrayBuffer>> {
    const bytes = await this.#document.readView(index);
    // Decompressed bytes have a buffer of their own.
    if (packingOf(this.#document.item('bufferViews', index))) return bytes as Uint8Array<ArrayBuffer>;
    this.#document.take(bytes.length);
    return bytes.slice() as Uint8Array<ArrayBuffer>;
  }

  /**
   * Checks that an accessor is within its buffer views.
   * @returns GPU memory of the accessor in bytes, including gaps between elements.
   */
  #check(index: number): number {
    const document = this.#document;
    const accessor = document.item('accessors', index);
    const path = `accessors[${index}]`;
    const { count, componentBytes, byteLength } = layoutOf(document, index);
    const { sparse } = accessor;
    if (isObject(sparse)) this.#checkSparse(sparse, count, byteLength, componentBytes, path);
    else if (sparse !== undefined) document.fail(`${path}.sparse`, 'an object', sparse);
    if (accessor.bufferView === undefined) return byteLength;
    const width = count > 0 ? byteLength / count : 0;
    const { byteStride = width } = document.item('bufferViews', accessor.bufferView);
    const isStride = document.isIndex(byteStride) && byteStride >= width && byteStride <= 252;
    // GPUs need strides of whole words.
    if (!isStride || (byteStride !== width && byteStride % 4 > 0))
      return document.fail(`${path}, byteStride`, 'a stride that its elements fit in', byteStride);
    const span = count === 0 ? 0 : (count - 1) * byteStride + width;
    this.#checkRange(accessor, span, componentBytes, path);
    const stored = count * byteStride;
    // Each accessor may have a GPU buffer of its own, with the bytes between its elements.
    document.take(stored - byteLength);
    return stored;
  }

  #checkSparse(sparse: Json, count: number, byteLength: number, componentBytes: number, path: string): void {
    const document = this.#document;
    const { indices, values } = sparse;
    const own = document.isIndex(sparse.count) && sparse.count <= count ? sparse.count : undefined;
    const size = isObject(indices) ? INDEX_BYTES.get(indices.componentType) : undefined;
    if (own === undefined || size === undefined || !isObject(indices) || !isObject(values))
      return document.fail(`${path}.sparse`, 'a count, indices and values', sparse);
    this.#checkRange(indices, own * size, size, `${path}.sparse.indices`);
    this.#checkRange(values, count === 0 ? 0 : (byteLength / count) * own, componentBytes, `${path}.sparse.values`);
  }

  #checkRange(place: Json, bytes: number, alignment: number, path: string): void {
    const document = this.#document;
    const { bufferView, byteOffset = 0 } = place;
    const view = document.item('bufferViews', bufferView);
    const packed = packingOf(view);
    const length = packed ? unpackedBytes(document, packed, bufferView as number) : view.byteLength;
    if (!document.isIndex(byteOffset) || byteOffset % alignment > 0)
      return document.fail(`${path}.byteOffset`, `a multiple of ${alignment}`, byteOffset);
    if (!document.isIndex(length))
      return document.fail(`bufferViews[${String(bufferView)}].byteLength`, 'a whole number', length);
    if (byteOffset + bytes > length)
      throw damaged(`${document.name}, ${path}`, `${grouped(byteOffset + bytes)} bytes`, grouped(length));
    this.#used.add(bufferView as number);
  }
}

function unpackedBytes(document: GltfDocument, packed: Json, view: number): number {
  const { count, stride } = meshoptParameters(document, packed, `bufferViews[${view}]`);
  return count * stride;
}
