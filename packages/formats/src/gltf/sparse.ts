import { grouped, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject } from '../json.js';
import type { SplatRange } from '../scene-format.js';
import { COMPONENTS, type GltfDocument } from './document.js';

/** Destination of the values of a sparse accessor. */
interface SparseTarget {
  readonly path: string;
  readonly componentType: unknown;
  /** Number of elements of the accessor. */
  readonly count: number;
  /** Range of elements that `values` contains. */
  readonly range: SplatRange;
  readonly width: number;
  readonly values: Float32Array;
}

/**
 * Writes the sparse values of an accessor to `target.values`, not normalized.
 * @param sparse Property `sparse` of the accessor.
 * @throws GaussianSplatError `decode/header`, `decode/corrupt`, `decode/truncated`, `out-of-memory/budget`
 */
export async function putSparse(document: GltfDocument, sparse: unknown, target: SparseTarget): Promise<void> {
  const path = `${target.path}.sparse`;
  const { count, indices, values } = isObject(sparse) ? sparse : document.fail(path, 'an object', sparse);
  if (!document.isIndex(count)) return document.fail(`${path}.count`, 'a whole number', count);
  const { width } = target;
  const indexType = isObject(indices) ? indices.componentType : undefined;
  if (indexType !== 5121 && indexType !== 5123 && indexType !== 5125)
    return document.fail(`${path}.indices.componentType`, '5121, 5123 or 5125', indexType);
  const at = await numbersIn(document, indices, `${path}.indices`, indexType, count);
  const read = await numbersIn(document, values, `${path}.values`, target.componentType, count * width);
  document.take(8 * count * width);
  const { first, end } = target.range;
  for (let k = 0; k < count; k++) {
    const element = at(k);
    if (element >= target.count) {
      const expected = `elements below ${grouped(target.count)}`;
      throw damaged(`${document.name}, ${path}.indices`, expected, grouped(element));
    }
    if (element < first || element >= end) continue;
    for (let c = 0; c < width; c++) target.values[(element - first) * width + c] = read(k * width + c);
  }
}

/** Returns a getter by index for contiguous numbers of one component type in a buffer view. */
async function numbersIn(
  document: GltfDocument,
  place: unknown,
  path: string,
  type: unknown,
  count: number,
): Promise<(k: number) => number> {
  const { bufferView, byteOffset = 0 } = isObject(place) ? place : document.fail(path, 'an object', place);
  if (!document.isIndex(byteOffset)) return document.fail(`${path}.byteOffset`, 'a whole number', byteOffset);
  const { bytes: size, get } = COMPONENTS.get(type)!;
  const bytes = await document.readView(bufferView);
  const end = byteOffset + count * size;
  if (end > bytes.length) throw damaged(`${document.name}, ${path}`, `${grouped(end)} bytes`, grouped(bytes.length));
  const view = viewOf(bytes);
  return (k) => get(view, byteOffset + k * size);
}
