/** Chunks of a `.4dgs` file: {@link chunksOf} reads their heads, and {@link stateOf} decodes their integers. */
import type { LoadBudget } from '../budget.js';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import {
  ATTRIBUTE,
  readBand,
  readStreams,
  unpackedBlock,
  wholeNumber,
  type AttributeId,
  type Bins,
} from './streams.js';
import { Cursor, OPCODE, type FileRecord, type TemporalModel } from './wire.js';

/** A chunk whose head is decoded. `from` and `until`, the times of its state, are in seconds. */
export interface Chunk {
  readonly from: number;
  readonly until: number;
  readonly level: number;
  /** Byte offset in the file of the chunk's record. */
  readonly offset: number;
  /** Bytes of the record, including the head. */
  readonly content: Uint8Array;
  /** Contents of the records of spherical harmonics that follow the chunk. */
  readonly bands: Uint8Array[];
  /** Number of splats that exist after the changes of the chunk. */
  readonly live: number;
  /** Number of splats that the chunk contains: all, or those that it updates, adds or removes. */
  readonly splats: number;
  /** Number of splats that the chunk adds; all splats of a keyframe. */
  readonly births: number;
  /** Index of the chunk whose state this delta changes. Undefined for a keyframe. */
  readonly reference?: number;
  /** Index of the keyframe that the state is based on; the chunk's own index if it is a keyframe. */
  readonly keyframe: number;
  /** Number of deltas from the keyframe to the state; 0 for a keyframe. */
  readonly depth: number;
}

const DELTA_MODE = { keyframe: 0, chained: 1 } as const;

/**
 * Reads the heads of all chunks in the order of the file, and compares them with the index.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`
 */
export function chunksOf(records: readonly FileRecord[], model: TemporalModel, name: string): Chunk[] {
  const chunks: Chunk[] = [];
  /** Index of each chunk by its byte offset. */
  const places = new Map<number, number>();
  for (const { opcode, offset, content } of records) {
    if (opcode === OPCODE.chunk) places.set(offset, chunks.push(wholeChunk(content, offset, chunks.length, name)) - 1);
    else if (opcode === OPCODE.deltaChunk && model === 'keyframe-delta')
      places.set(offset, chunks.push(deltaChunk(content, offset, chunks, places, name)) - 1);
    else if (opcode === OPCODE.shBand && chunks.length > 0) chunks[chunks.length - 1].bands.push(content);
    else if (opcode === OPCODE.chunkIndex) checkEntry(content, chunks, places, name);
  }
  if (model === 'keyframe-delta') requireTiles(chunks, name);
  return chunks;
}

function wholeChunk(content: Uint8Array, offset: number, keyframe: number, name: string): Chunk {
  const cursor = new Cursor(content, name);
  const [from, until, level, live] = [cursor.f64(), cursor.f64(), cursor.u32(), cursor.u32()];
  const counts = { live, splats: live, births: live };
  return { ...span(from, until, name), level, offset, content, bands: [], ...counts, keyframe, depth: 0 };
}

function span(from: number, until: number, name: string): Pick<Chunk, 'from' | 'until'> {
  if (from <= until && Math.abs(from) < 1e9 && (Math.abs(until) < 1e9 || until === Infinity)) return { from, until };
  throw damaged(name, 'chunks that begin before they end', `${from} to ${until} s`, 'decode/header');
}

function deltaChunk(
  content: Uint8Array,
  offset: number,
  chunks: readonly Chunk[],
  places: ReadonlyMap<number, number>,
  name: string,
): Chunk {
  const cursor = new Cursor(content, name);
  const [from, until, level, mode] = [cursor.f64(), cursor.f64(), cursor.u32(), cursor.u8()];
  const [referenceAt, keyframeAt, depth] = [cursor.u64(), cursor.u64(), cursor.u16()];
  const [updates, births, deaths] = [cursor.u32(), cursor.u32(), cursor.u32()];
  const reference = places.get(referenceAt) ?? -1;
  const before = reference < 0 ? undefined : chunks[reference];
  const isPrevious = mode === DELTA_MODE.keyframe ? before?.depth === 0 : reference === chunks.length - 1;
  const isDeep = before?.depth === depth - 1 && chunks[before.keyframe].offset === keyframeAt;
  if (before === undefined || mode > DELTA_MODE.chained || !isPrevious || !isDeep)
    throw damaged(name, 'changes of a chunk before, as deep as they say', `a reference to byte ${referenceAt}`);
  const { live, level: other, keyframe } = before;
  if (level !== other) throw damaged(name, `changes of level ${other}, as their reference`, `level ${level}`);
  if (updates + deaths > live || live + births > 2 ** 32)
    throw damaged(name, `changes of ${grouped(live)} splats`, grouped(updates + deaths), 'decode/header');
  return {
    ...{ ...span(from, until, name), level, offset, content, bands: [], reference, births, keyframe, depth },
    ...{ live: live + births - deaths, splats: updates + births + deaths },
  };
}

/** Returns the indices of the chunks that lead to the state of chunk `last`: its keyframe, then the deltas in order. */
export function chainOf(chunks: readonly Chunk[], last: number): number[] {
  const chain: number[] = [];
  for (let k: number | undefined = last; k !== undefined; k = chunks[k].reference) chain.push(k);
  return chain.reverse();
}

/** Throws unless the first chunk begins at 0 s and each chunk begins at the end of the previous one. */
function requireTiles(chunks: readonly Chunk[], name: string): void {
  let end = 0;
  for (const { from, until } of chunks) {
    if (from !== end) throw damaged(name, `a state from ${end} s on`, `one from ${from} s on`);
    end = until;
  }
}

function checkEntry(
  content: Uint8Array,
  chunks: readonly Chunk[],
  places: ReadonlyMap<number, number>,
  name: string,
): void {
  const cursor = new Cursor(content, `${name}, index`);
  cursor.numbers(2);
  const offset = cursor.u64();
  cursor.u64();
  const [splats, bands] = [cursor.u32(), cursor.u32()];
  const chunk = chunks[places.get(offset) ?? -1] as Chunk | undefined;
  if (!chunk) throw damaged(cursor.name, 'offsets of chunks', `byte ${offset}`, 'decode/header');
  cursor.take(17 * bands);
  const isLong = cursor.left >= 28;
  if (isLong) cursor.take(20);
  const live = isLong ? cursor.u64() : chunk.live;
  if (splats === chunk.splats && live === chunk.live) return;
  const said = (a: number, b: number): string => `${grouped(a)} splats, ${grouped(b)} there`;
  throw damaged(cursor.name, said(chunk.splats, chunk.live), said(splats, live), 'decode/header');
}

/**
 * Stored integers of all splats at one point in time: the attributes, and the coefficients of spherical harmonics above
 * the constant one. `bands[k]` contains those of degree k + 1: [N, 3, 2k + 3], 0 to 255.
 */
export interface State {
  readonly bins: Bins;
  readonly bands: readonly Int32Array[];
}

export interface Decoding {
  readonly name: string;
  readonly budget: LoadBudget;
  readonly shDegree: number;
}

/**
 * Decodes the state of the last chunk of a chain.
 * @param chain Indices that {@link chainOf} returns.
 * @param known A chunk whose state is known, and that state. If it is in the chain, only the changes after it are decoded.
 */
export async function stateOf(
  chunks: readonly Chunk[],
  chain: readonly number[],
  decoding: Decoding,
  known?: KnownState,
): Promise<State> {
  const after = known ? chain.indexOf(known.chunk) + 1 : 0;
  let state = after > 0 ? known!.state : await wholeState(chunks[chain[0]], decoding);
  for (const k of chain.slice(Math.max(1, after))) state = await changedState(state, chunks[k], decoding);
  return state;
}

export interface KnownState {
  readonly chunk: number;
  readonly state: State;
}

async function wholeState({ content, bands, live }: Chunk, decoding: Decoding): Promise<State> {
  const cursor = new Cursor(content, decoding.name);
  cursor.take(24);
  const bins = await readStreams(
    new Cursor(await unpackedBlock(cursor, decoding.budget), decoding.name),
    live,
    decoding,
  );
  return { bins, bands: await bandsOf(bands, live, decoding) };
}

async function bandsOf(records: readonly Uint8Array[], count: number, decoding: Decoding): Promise<Int32Array[]> {
  const { name, shDegree } = decoding;
  const found: Int32Array[] = [];
  for (const record of records) {
    const cursor = new Cursor(record, name);
    const band = cursor.u8();
    if (band < 1 || band > shDegree || found[band - 1])
      throw damaged(name, `bands 1 to ${shDegree}, once each`, `band ${band}`, 'decode/header');
    found[band - 1] = await readBand(cursor, count, band, decoding);
  }
  if (count === 0) return Array.from({ length: shDegree }, () => new Int32Array(0));
  if (found.filter(Boolean).length === shDegree) return found;
  throw damaged(name, `${shDegree} bands of spherical harmonics`, String(records.length), 'decode/header');
}

/** Attributes that a delta may not change, because the quantization steps of other attributes depend on them. */
const FIXED: readonly AttributeId[] = [ATTRIBUTE.sigma, ATTRIBUTE.flags, ATTRIBUTE.window];
/** Attributes whose values a delta replaces. To all other attributes, a delta adds its values. */
const REPLACED: readonly AttributeId[] = [ATTRIBUTE.rotationIndex, ATTRIBUTE.rotation];

async function changedState(before: State, chunk: Chunk, decoding: Decoding): Promise<State> {
  const { name, budget } = decoding;
  const cursor = new Cursor(chunk.content, name);
  cursor.take(16 + 4 + 1 + 8 + 8 + 2);
  const counts = [cursor.u32(), cursor.u32(), cursor.u32()];
  const groups = new Cursor(await unpackedBlock(cursor, budget), name);
  const read = async (count: number): Promise<Bins> => readStreams(new Cursor(groups.block(), name), count, decoding);
  const [updates, births, deaths] = [await read(counts[0]), await read(counts[1]), await read(counts[2])];
  const wrong = FIXED.find((id) => updates.has(id));
  if (wrong !== undefined) throw damaged(name, 'changes that leave grids alone', `attribute ${wrong}`, 'decode/header');
  const rowOf = rowsById(before.bins, name);
  const [changed, born, dead] = [updates, births, deaths].map((group, k) => idsOf(group, counts[k], name));
  const touched = new Set([...changed, ...dead, ...born]);
  const isKnown = (id: number): boolean => rowOf.has(id);
  if (touched.size !== counts[0] + counts[1] + counts[2] || ![...changed, ...dead].every(isKnown) || born.some(isKnown))
    throw damaged(name, 'splats that change or go once each, and are there', 'others');
  const gone = new Set(dead);
  const kept = [...rowOf].filter(([id]) => !gone.has(id)).map(([, row]) => row);
  const place = new Map(kept.map((row, k) => [row, k]));
  const bins = new Map<AttributeId, Int32Array>();
  for (const [id, values] of before.bins) {
    const channels = values.length / rowOf.size;
    const own = joined(values, kept, channels, births.get(id), counts[1], budget, name);
    const change = id === ATTRIBUTE.id ? undefined : updates.get(id);
    if (change)
      changed.forEach((changedId, i) => {
        const row = place.get(rowOf.get(changedId)!)!;
        for (let c = 0; c < channels; c++) {
          const value = change[channels * i + c];
          own[channels * row + c] = REPLACED.includes(id) ? value : wholeNumber(own[channels * row + c] + value, name);
        }
      });
    bins.set(id, own);
  }
  const bornBands = await bandsOf(chunk.bands, counts[1], decoding);
  const bands = before.bands.map((values, k) =>
    joined(values, kept, 3 * (2 * k + 3), bornBands[k], counts[1], budget, name),
  );
  return { bins, bands };
}

/** Returns the `kept` rows of `values`, followed by the added rows. Each row has `channels` values. */
function joined(
  values: Int32Array,
  kept: readonly number[],
  channels: number,
  added: Int32Array | undefined,
  births: number,
  budget: LoadBudget,
  name: string,
): Int32Array {
  if (births > 0 && !added) throw damaged(name, 'all attributes of splats that come', 'some', 'decode/header');
  budget.take(4 * channels * (kept.length + births), name);
  const own = new Int32Array(channels * (kept.length + births));
  kept.forEach((row, k) => own.set(values.subarray(channels * row, channels * (row + 1)), channels * k));
  if (added) own.set(added, channels * kept.length);
  return own;
}

function idsOf(bins: Bins, count: number, name: string): number[] {
  const ids = bins.get(ATTRIBUTE.id);
  // Without a stream, nothing has been charged for this count.
  if (!ids && count > 0) throw damaged(name, 'indices of splats', 'none', 'decode/header');
  return Array.from(ids ?? []);
}

/** Returns the row of each splat by its id. Throws `decode/header` without ids, `decode/corrupt` if one occurs twice. */
export function rowsById(bins: Bins, name: string): Map<number, number> {
  const ids = bins.get(ATTRIBUTE.id);
  if (!ids) throw damaged(name, 'indices of splats', 'none', 'decode/header');
  const rows = new Map(Array.from(ids, (id, row) => [id, row]));
  if (rows.size === ids.length) return rows;
  throw damaged(name, 'splats with different indices', 'an index twice');
}
