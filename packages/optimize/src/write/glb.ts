import type { GaussianCloud } from '@gaussian-splat/core';
import { assetOfCredits, upright } from '@gaussian-splat/formats';
import type { WrittenCloud } from './index.js';
import { arraysOf, columnsOf, type Columns } from '../parts/cloud-memory.js';
import { inline, partsOf, poolFor, type TaskPool } from '../parts/task-pool.js';
import { fileBytes, MAX_UINT32, requireAtMost } from './file-bytes.js';
import { EXTENSION, glbColumns, placeBounds, placeOf, type GlbColumn } from './glb-columns.js';

const [FLOAT, SHORT] = [5126, 5122];

/** Properties of `KHR_gaussian_splatting` in every primitive. */
const SPLATS = {
  kernel: 'ellipse',
  colorSpace: 'srgb_rec709_display',
  sortingMethod: 'cameraDistance',
  projection: 'perspective',
};

/** A glTF primitive with the splats of one SH degree. */
interface Primitive {
  readonly degree: number;
  readonly splats: Uint32Array;
  readonly columns: readonly GlbColumn[];
  readonly bounds: object;
}

/**
 * Writes GLB with `KHR_gaussian_splatting`: one primitive for each degree that splats keep, so that dropped
 * coefficients take no bytes. Rotations are 16-bit normalized integers, which the extension allows; everything else is
 * float32.
 *
 * A scene with an up direction other than (0, -1, 0) is rotated.
 *
 * @returns The file, in memory that the pool's tasks share.
 * @throws GaussianSplatError `argument/value` for a file of 4 GiB or more, before its allocation;
 * `out-of-memory/allocation`
 */
export async function writeGlb({ cloud: given, degrees }: WrittenCloud, pool: TaskPool = inline): Promise<Uint8Array> {
  const cloud = upright(given);
  const columns = columnsOf(cloud);
  const primitives = [0, 1, 2, 3].flatMap((degree) => primitiveOf(columns, splatsOf(degrees, degree), degree));
  const { json, byteLength, starts } = describe(primitives, cloud);
  const { bytes, start } = containerOf(json, byteLength, pool);
  const workers = poolFor(pool, cloud.count, arraysOf(columns));
  const inputs = primitives.flatMap(({ degree, splats }, k) =>
    partsOf(splats.length, workers).map(({ first, end }) => ({
      ...{ columns, bytes, degree, at: first, splats: splats.slice(first, end) },
      starts: starts[k].map((byte) => start + byte),
    })),
  );
  await workers.run('putColumns', inputs);
  return bytes;
}

/** Returns the indices of the splats that keep a degree, ascending. */
function splatsOf(degrees: Uint8Array, degree: number): Uint32Array {
  const members = new Uint32Array(degrees.length);
  let count = 0;
  for (let i = 0; i < degrees.length; i++) if (degrees[i] === degree) members[count++] = i;
  return members.subarray(0, count);
}

function primitiveOf(columns: Columns, splats: Uint32Array, degree: number): Primitive[] {
  if (splats.length === 0) return [];
  return [{ degree, splats, columns: glbColumns(columns, degree), bounds: placeBounds(columns, splats) }];
}

/**
 * Returns the JSON of the file, the byte length of the binary data, and `starts`: for each primitive, the byte offsets of
 * its attributes in the binary data.
 */
function describe(
  primitives: readonly Primitive[],
  { origin, hints }: Pick<GaussianCloud, 'origin' | 'hints'>,
): { json: object; byteLength: number; starts: number[][] } {
  // The extension declares only the default order; `extras` holds any other.
  const splats = hints?.order ? { ...SPLATS, extras: { sortingMethod: hints.order } } : SPLATS;
  const bufferViews: object[] = [];
  const accessors: object[] = [];
  let byteLength = 0;
  const starts: number[][] = [];
  const add = ({ name, width, isShort }: GlbColumn, { splats, bounds }: Primitive, k: number): number => {
    const length = (isShort ? 2 : 4) * width * splats.length;
    bufferViews.push({ buffer: 0, byteOffset: byteLength, byteLength: length });
    (starts[k] ??= []).push(byteLength);
    byteLength += length;
    return (
      accessors.push({
        bufferView: bufferViews.length - 1,
        componentType: isShort ? SHORT : FLOAT,
        ...(isShort && { normalized: true }),
        count: splats.length,
        type: width === 1 ? 'SCALAR' : `VEC${width}`,
        ...(name === 'POSITION' && bounds),
      }) - 1
    );
  };
  const meshPrimitives = primitives.map((primitive, k) => ({
    mode: 0,
    attributes: Object.fromEntries(primitive.columns.map((column) => [column.name, add(column, primitive, k)])),
    extensions: { [EXTENSION]: splats },
  }));
  const json = {
    asset: { version: '2.0', generator: 'gaussian-splat optimize', ...assetOfCredits(hints?.credits) },
    extensionsUsed: [EXTENSION],
    scene: 0,
    scenes: [{ nodes: [0] }],
    // The origin is a translation, because float32 positions far from (0, 0, 0) would lose detail.
    nodes: [{ mesh: 0, ...(origin.some((x) => x !== 0) && { translation: placeOf(origin) }) }],
    meshes: [{ primitives: meshPrimitives }],
    accessors,
    bufferViews,
    buffers: [{ byteLength }],
  };
  return { json, byteLength, starts };
}

/** Returns a GLB whose binary chunk contains only zeros, and the byte offset of the data of this chunk. */
function containerOf(json: object, byteLength: number, pool: TaskPool): { bytes: Uint8Array; start: number } {
  const text = new TextEncoder().encode(JSON.stringify(json));
  const textLength = text.length + (-text.length & 3);
  const total = 28 + textLength + byteLength;
  requireAtMost('GLB', total, MAX_UINT32, 'bytes');
  const bytes = fileBytes('GLB', total, (length) => pool.allocate(length));
  const view = new DataView(bytes.buffer);
  const words = (at: number, ...values: number[]): void =>
    values.forEach((value, k) => view.setUint32(at + 4 * k, value, true));
  // "glTF", version 2, length; then length and type "JSON" of the first chunk.
  words(0, 0x46546c67, 2, bytes.length, textLength, 0x4e4f534a);
  bytes.fill(0x20, 20, 20 + textLength);
  bytes.set(text, 20);
  // Length and type "BIN\0" of the second chunk.
  words(20 + textLength, byteLength, 0x004e4942);
  return { bytes, start: 28 + textLength };
}
