import { asciiOf, grouped, startsWith, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject, parseJson, show, type Json } from '../json.js';
import type { SceneSource } from '../scene-format.js';
import { noParts } from '../readers/sog.js';

const MAX_JSON_BYTES = 1 << 24;
/** Bytes of the signature and of the length of the JSON description. */
const START_BYTES = 8;

/** A property of the splats of a chunk, encoded. `min` and `max` are the bounds of quantized values. */
export interface RadProperty {
  readonly name: string;
  readonly encoding: string;
  readonly isDeflated: boolean;
  readonly bytes: Uint8Array;
  readonly min: number;
  readonly max: number;
}

/** A chunk of a scene: some of its splats, in the order of the file. */
export interface RadChunk {
  /** Name of the chunk in error messages. */
  readonly where: string;
  readonly count: number;
  /** Degree of the spherical harmonics, 0 to 3. */
  readonly degree: number;
  /** Whether splats are the nodes of a tree. Splats without children are then the finest level. */
  readonly isTree: boolean;
  /** Number of entries in the file's palette of spherical harmonics; undefined if the file declares none. */
  readonly paletteCount: number | undefined;
  readonly properties: readonly RadProperty[];
}

/** Place of a chunk: bytes `first` to `end`, excluding `end`, of the scene's file, or a file beside it. */
export interface RadPlace {
  readonly file?: string;
  readonly first: number;
  readonly end: number;
}

/** Description at the beginning of a RAD file. */
export interface RadHead {
  readonly places: readonly RadPlace[];
  /** Number of splats of all chunks. */
  readonly count: number;
  /** Number of splats of each chunk except the last. */
  readonly chunkSize: number;
  /** Whether splats are the nodes of a tree, so that the file has levels of detail. */
  readonly isTree: boolean;
  /** Number of entries in the file's palette of spherical harmonics; undefined if the file declares none. */
  readonly paletteCount: number | undefined;
}

/** Returns the number of bytes of the description at the beginning of a file, with its signature. */
export const radHeadBytes = (bytes: Uint8Array): number =>
  START_BYTES + (bytes.length < START_BYTES ? 0 : viewOf(bytes).getUint32(4, true));

/**
 * Parses the description at the beginning of a RAD file.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/unsupported`
 */
export function parseRadHead({ bytes, name, budget }: Pick<SceneSource, 'bytes' | 'name' | 'budget'>): RadHead {
  const { json, end } = descriptionAt({ budget }, bytes, 'RAD0', name);
  const { type, version, chunks, shCodeCount, lodTree, count: splats = 0, chunkSize = splats } = json;
  const paletteCount = shCodeCount === undefined ? undefined : count(shCodeCount, `${name}, shCodeCount`);
  if (version !== 1 || type !== 'gsplat')
    throw damaged(`${name}, version`, 'version 1 of type gsplat', show([version, type]), 'decode/unsupported');
  if (!Array.isArray(chunks)) throw damaged(`${name}, chunks`, 'a list', show(chunks), 'decode/header');
  const places = chunks.map((chunk: unknown, k): RadPlace => {
    const where = `${name}, chunks[${k}]`;
    if (!isObject(chunk)) throw damaged(where, 'an object', show(chunk), 'decode/header');
    const { filename: file, offset, bytes: length } = chunk;
    if (typeof file === 'string') return { file, first: 0, end: 0 };
    const first = end + count(offset, `${where}.offset`);
    return { first, end: first + count(length, `${where}.bytes`) };
  });
  const own = { count: count(splats, `${name}, count`), chunkSize: count(chunkSize, `${name}, chunkSize`) };
  return { places, ...own, isTree: lodTree === true, paletteCount };
}

/**
 * Iterates over the chunks of a RAD file in order, including those in separate files. A file may be a single chunk.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`, `decode/unsupported`,
 * `out-of-memory/budget`; errors of opening another file
 */
export async function* chunksOf(source: SceneSource): AsyncGenerator<RadChunk> {
  const { bytes, name, budget } = source;
  if (startsWith(bytes, 'RADC')) {
    yield chunkIn(source, bytes, name);
    return;
  }
  const { places, paletteCount } = parseRadHead(source);
  for (const [k, { file, first, end }] of places.entries()) {
    if (file !== undefined) {
      const content = await (source.openFile ?? noParts(name, 'scene.rad'))(file);
      yield chunkIn(source, content, `${name}, ${file}`, paletteCount);
      continue;
    }
    const where = `${name}, chunks[${k}]`;
    if (end > bytes.length) throw damaged(where, `${grouped(end)} bytes`, grouped(bytes.length), 'decode/truncated');
    // Each chunk is charged, because a list may refer to the same chunk repeatedly.
    budget.take(end - first, where);
    yield chunkIn(source, bytes.subarray(first, end), where, paletteCount);
  }
}

/**
 * Parses a chunk. Its properties are not decoded.
 * @param where Name of the chunk in error messages.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`, `decode/unsupported`
 */
export function chunkIn(
  { budget }: Pick<SceneSource, 'budget'>,
  bytes: Uint8Array,
  where: string,
  paletteCount?: number,
): RadChunk {
  const { json, end } = descriptionAt({ budget }, bytes, 'RADC', where);
  const { version, maxSh = 0, lodTree = false, properties } = json;
  if (version !== 1) throw damaged(`${where}, version`, 'version 1', show(version), 'decode/unsupported');
  if (![0, 1, 2, 3].includes(maxSh as number)) throw damaged(`${where}, maxSh`, '0 to 3', show(maxSh));
  if (!Array.isArray(properties)) throw damaged(`${where}, properties`, 'a list', show(properties), 'decode/header');
  // The 8 bytes after the description are the length of the properties.
  const payload = end + 8;
  return {
    where,
    count: count(json.count, `${where}, count`),
    degree: maxSh as number,
    isTree: lodTree === true,
    paletteCount,
    properties: properties.map((property, k) => propertyOf(property, bytes, payload, `${where}, properties[${k}]`)),
  };
}

function propertyOf(property: unknown, bytes: Uint8Array, payload: number, where: string): RadProperty {
  if (!isObject(property)) throw damaged(where, 'an object', show(property), 'decode/header');
  const { property: name, encoding, compression, min = 0, max = 1 } = property;
  const first = payload + count(property.offset, `${where}.offset`);
  const last = first + count(property.bytes, `${where}.bytes`);
  if (last > bytes.length) throw damaged(where, `${grouped(last)} bytes`, grouped(bytes.length), 'decode/truncated');
  if (compression !== undefined && compression !== 'gz')
    throw damaged(`${where}.compression`, '"gz" or nothing', show(compression), 'decode/unsupported');
  if (typeof name !== 'string' || typeof encoding !== 'string')
    throw damaged(where, 'names of a property and its encoding', show([name, encoding]), 'decode/header');
  if (![min, max].every(Number.isFinite)) throw damaged(where, 'finite bounds', show([min, max]));
  return {
    ...{ name, encoding, isDeflated: compression === 'gz' },
    ...{ bytes: bytes.subarray(first, last), min: min as number, max: max as number },
  };
}

/** Reads the JSON description after a signature and a length. `end` is the byte after the padding to a multiple of 8. */
function descriptionAt(
  { budget }: Pick<SceneSource, 'budget'>,
  bytes: Uint8Array,
  signature: string,
  name: string,
): { json: Json; end: number } {
  if (!startsWith(bytes, signature))
    throw damaged(name, signature, JSON.stringify(asciiOf(bytes, 0, 4)), 'decode/header');
  const end = radHeadBytes(bytes);
  if (bytes.length < Math.max(START_BYTES, end))
    throw damaged(name, `${grouped(end)} bytes`, grouped(bytes.length), 'decode/truncated');
  const json = parseJson({ bytes: bytes.subarray(START_BYTES, end), name, budget }, MAX_JSON_BYTES);
  return { json, end: START_BYTES + 8 * Math.ceil((end - START_BYTES) / 8) };
}

function count(value: unknown, where: string): number {
  if (!Number.isSafeInteger(value) || (value as number) < 0)
    throw damaged(where, 'a whole number, 0 or more', show(value), 'decode/header');
  return value as number;
}
