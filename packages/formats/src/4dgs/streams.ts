/** Attribute streams of a `.4dgs` file, which are compressed integers. */
import type { LoadBudget } from '../budget.js';
import { grouped } from '../bytes.js';
import { decompressing } from '../decompression.js';
import { damaged } from '../faults.js';
import { decompressZstd } from '../zstd/decompress.js';
import type { Cursor } from './wire.js';

export const ATTRIBUTE = {
  ...{ position: 0, scale: 1, rotationIndex: 2, rotation: 3, color: 4, opacity: 5, motion: 6, mu: 7 },
  ...{ sigma: 8, flags: 9, window: 10, id: 13, object: 14 },
} as const;
export type AttributeId = (typeof ATTRIBUTE)[keyof typeof ATTRIBUTE];

/** Count of integers of each attribute for a splat. */
export const CHANNELS: Readonly<Record<AttributeId, number>> = {
  ...{ 0: 3, 1: 3, 2: 1, 3: 3, 4: 3, 5: 1, 6: 3, 7: 1 },
  ...{ 8: 1, 9: 1, 10: 1, 13: 1, 14: 1 },
};
/** Attributes that every splat must have. */
export const REQUIRED: readonly AttributeId[] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10];

const MODE = { raw: 0, delta: 1, constant: 2 } as const;
const CODECS = ['deflate', 'zstd'] as const;

/** Integers of some splats by attribute, [splats, channels]. */
export type Bins = ReadonlyMap<AttributeId, Int32Array>;

export interface StreamFile {
  readonly name: string;
  readonly budget: LoadBudget;
}

/** Reads the streams up to the end of the cursor's bytes. Unknown attributes are skipped. */
export async function readStreams(cursor: Cursor, count: number, file: StreamFile): Promise<Bins> {
  const found = new Map<AttributeId, Int32Array>();
  while (cursor.left > 0) {
    const stream = readStreamHead(cursor);
    const channels = CHANNELS[stream.attribute as AttributeId] as number | undefined;
    if (channels === undefined) continue;
    requireCounts(stream, count, channels, file.name);
    found.set(stream.attribute as AttributeId, await decodeStream(stream, file));
  }
  return found;
}

/** Reads the bytes 0..255 of the spherical harmonics of degree `band`, [splats, 3, 2·band + 1]. */
export async function readBand(cursor: Cursor, count: number, band: number, file: StreamFile): Promise<Int32Array> {
  const stream = readStreamHead(cursor);
  requireCounts(stream, count, 3 * (2 * band + 1), file.name);
  const codes = await decodeStream(stream, file);
  if (codes.every((code) => code >= 0 && code <= 255)) return codes;
  throw damaged(file.name, 'coefficients of one byte', 'others');
}

interface Stream {
  readonly attribute: number;
  readonly width: number;
  readonly mode: number;
  readonly codec: number;
  readonly channels: number;
  readonly count: number;
  readonly payload: Uint8Array;
}

function readStreamHead(cursor: Cursor): Stream {
  const [attribute, width, mode, codec, channels] = cursor.take(5);
  const count = cursor.u32();
  return { attribute, width, mode, codec, channels, count, payload: cursor.block() };
}

function requireCounts({ attribute, count, channels }: Stream, splats: number, max: number, name: string): void {
  if (count === splats && channels === max) return;
  throw damaged(
    `${name}, attribute ${attribute}`,
    `${max} numbers of ${grouped(splats)} splats`,
    `${channels} of ${grouped(count)}`,
    'decode/header',
  );
}

async function decodeStream(stream: Stream, { name, budget }: StreamFile): Promise<Int32Array> {
  const { attribute, width, mode, codec, channels, count } = stream;
  const where = `${name}, attribute ${attribute}`;
  if (CODECS[codec] === undefined)
    throw damaged(where, `streams of ${CODECS.join(' and ')}`, `codec ${codec}`, 'decode/unsupported');
  if (![1, 2, 4].includes(width)) throw damaged(where, 'symbols of 1, 2 or 4 bytes', `${width}`, 'decode/header');
  if (mode > MODE.constant) throw damaged(where, 'mode 0, 1 or 2', `mode ${mode}`, 'decode/header');
  const symbols = count === 0 ? 0 : mode === MODE.constant ? channels : count * channels;
  budget.take(symbols * width + 4 * count * channels, name);
  const raw = count === 0 ? new Uint8Array(0) : await decompressed(stream.payload, codec, symbols * width, where);
  const values = new Int32Array(count * channels);
  for (let i = 0; i < symbols; i++) {
    let code = 0;
    for (let plane = width - 1; plane >= 0; plane--) code = 256 * code + raw[plane * symbols + i];
    // Codes 0, 1, 2, 3, ... are the integers 0, -1, 1, -2, ...
    values[i] = code % 2 === 0 ? code / 2 : -(code + 1) / 2;
  }
  if (mode === MODE.constant) for (let i = channels; i < values.length; i++) values[i] = values[i % channels];
  if (mode === MODE.delta)
    for (let i = channels; i < values.length; i++) values[i] = wholeNumber(values[i] + values[i - channels], where);
  return values;
}

/** Returns `sum` if it is an integer of 32 bits. Throws `decode/corrupt` otherwise. */
export function wholeNumber(sum: number, where: string): number {
  if (sum === (sum | 0)) return sum;
  throw damaged(where, 'sums of 32 bits', String(sum));
}

/** Decompresses a block to `length` bytes. @param codec Index in {@link CODECS}. */
async function decompressed(bytes: Uint8Array, codec: number, length: number, where: string): Promise<Uint8Array> {
  return CODECS[codec] === 'zstd' ? unpackedZstd(bytes, length, where) : inflated(bytes, length, where);
}

/** Reads a block, and decompresses it if it names a codec. */
export async function unpackedBlock(cursor: Cursor, budget: LoadBudget): Promise<Uint8Array> {
  const { name } = cursor;
  const [compression, length, stored] = [cursor.text(), cursor.u64(), cursor.block()];
  if (compression === '') return stored;
  const codec = CODECS.indexOf(compression as (typeof CODECS)[number]);
  if (codec < 0)
    throw damaged(name, `chunks of ${CODECS.join(' and ')}`, JSON.stringify(compression), 'decode/unsupported');
  budget.take(length, name);
  return decompressed(stored, codec, length, name);
}

function unpackedZstd(bytes: Uint8Array, length: number, where: string): Uint8Array {
  try {
    const found = decompressZstd(bytes, length);
    if (found.length === length) return found;
  } catch (cause) {
    throw damaged(where, 'an intact zstd stream', 'a damaged one', 'decode/corrupt', cause);
  }
  throw damaged(where, `${grouped(length)} bytes`, 'others', 'decode/truncated');
}

async function inflated(bytes: Uint8Array, length: number, where: string): Promise<Uint8Array> {
  const reader = decompressing(bytes, 'deflate');
  const found = new Uint8Array(length);
  let at = 0;
  try {
    for (;;) {
      const { value } = await reader.read().catch((cause: unknown) => {
        throw damaged(where, 'an intact deflate stream', 'a damaged one', 'decode/corrupt', cause);
      });
      if (value === undefined) break;
      if (at + value.length > length) throw damaged(where, `${grouped(length)} bytes`, 'more', 'decode/truncated');
      found.set(value, at);
      at += value.length;
    }
  } finally {
    reader.cancel().catch(() => {});
  }
  if (at === length) return found;
  throw damaged(where, `${grouped(length)} bytes`, grouped(at), 'decode/truncated');
}
