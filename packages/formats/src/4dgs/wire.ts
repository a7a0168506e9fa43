/** Records of a `.4dgs` file: https://github.com/avala-ai/4dgs, website/docs/spec, version 1. */
import type { ShDegree, Vector3 } from '@gaussian-splat/core';
import { asciiOf, grouped, quote, startsWith, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';

const MAGIC = '\x894DGS1\r\n';
const VERSION_AT = 5;

export const OPCODE = {
  ...{ header: 0x01, footer: 0x02, quantization: 0x03, windows: 0x04, chunk: 0x05, shBand: 0x07 },
  ...{ chunkIndex: 0x08, deltaChunk: 0x10, frame: 0x20, objectTrack: 0x25 },
} as const;

/** Opcodes of records that must precede the first splats, because they describe the scene. */
const IN_FRONT = new Set([0x01, 0x03, 0x04, 0x09, 0x0a, 0x0b, 0x0d, 0x11, 0x12, 0x20, 0x21, 0x22, 0x23, 0x24, 0x25]);

/** Reads little-endian fields in sequence. All methods throw `decode/truncated` at the end of the bytes. */
export class Cursor {
  readonly name: string;
  readonly #bytes: Uint8Array;
  readonly #view: DataView;
  #at = 0;

  constructor(bytes: Uint8Array, name: string) {
    this.#bytes = bytes;
    this.#view = viewOf(bytes);
    this.name = name;
  }

  get left(): number {
    return this.#bytes.length - this.#at;
  }

  take(length: number): Uint8Array {
    if (length > this.left)
      throw damaged(this.name, `${grouped(length)} more bytes`, grouped(this.left), 'decode/truncated');
    return this.#bytes.subarray(this.#at, (this.#at += length));
  }

  u8 = (): number => this.take(1)[0];
  u16 = (): number => this.#view.getUint16(this.#skip(2), true);
  u32 = (): number => this.#view.getUint32(this.#skip(4), true);
  f64 = (): number => this.#view.getFloat64(this.#skip(8), true);

  u64(): number {
    const value = Number(this.#view.getBigUint64(this.#skip(8), true));
    if (Number.isSafeInteger(value)) return value;
    throw damaged(this.name, 'lengths that can be counted', String(value), 'decode/header');
  }

  numbers = (count: number): number[] => Array.from({ length: count }, this.f64);
  text = (): string => new TextDecoder().decode(this.take(this.u32()));
  block = (): Uint8Array => this.take(this.u64());

  #skip(length: number): number {
    this.take(length);
    return this.#at - length;
  }
}

export interface FileRecord {
  readonly opcode: number;
  /** Byte offset in the file of the record; its content begins 9 bytes later. */
  readonly offset: number;
  readonly content: Uint8Array;
}

/**
 * Returns the complete records of a file; those of a truncated file before its end.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported` for other versions
 */
export function recordsOf(bytes: Uint8Array, name: string): FileRecord[] {
  requireMagic(bytes, name);
  const view = viewOf(bytes);
  const found: FileRecord[] = [];
  let hasSplats = false;
  for (let at = MAGIC.length; at + 9 <= bytes.length;) {
    const opcode = bytes[at];
    const length = Number(view.getBigUint64(at + 1, true));
    if (length > bytes.length - at - 9) break;
    if (hasSplats && IN_FRONT.has(opcode))
      throw damaged(name, `no record ${hex(opcode)} behind the first splats`, 'one', 'decode/header');
    hasSplats ||= opcode === OPCODE.chunk;
    found.push({ opcode, offset: at, content: bytes.subarray(at + 9, at + 9 + length) });
    at += 9 + length;
    if (opcode === OPCODE.footer) break;
  }
  if (found[0]?.opcode !== OPCODE.header)
    throw damaged(name, 'a header as its first record', found[0] ? hex(found[0].opcode) : 'none', 'decode/header');
  return found;
}

const hex = (opcode: number): string => `0x${opcode.toString(16).padStart(2, '0')}`;

function requireMagic(bytes: Uint8Array, name: string): void {
  if (startsWith(bytes, MAGIC)) return;
  const version = asciiOf(bytes, VERSION_AT, VERSION_AT + 1);
  const isOtherVersion = startsWith(bytes, MAGIC.slice(0, VERSION_AT)) && startsWith(bytes, '\r\n', VERSION_AT + 1);
  if (isOtherVersion) throw damaged(name, '.4dgs of version 1', `version ${quote(version)}`, 'decode/unsupported');
  throw damaged(name, 'a .4dgs file', 'another signature', 'decode/header');
}

/**
 * Model of changes over time. `gaussian-birth`: chunks are independent, and each splat has a time. `keyframe-delta`: a
 * chunk is a keyframe, or adds, changes and removes splats of a previous chunk.
 */
export type TemporalModel = 'gaussian-birth' | 'keyframe-delta';
const MODELS: readonly string[] = ['gaussian-birth', 'keyframe-delta'] satisfies TemporalModel[];

export interface Header {
  /** Infinity if the last state has no end. */
  readonly durationSeconds: number;
  readonly splats: number;
  /** Minimum fraction of its opacity, 0..1, at which a splat that fades is drawn. */
  readonly cutoff: number;
  readonly model: TemporalModel;
  readonly shDegree: ShDegree;
}

export function readHeader(cursor: Cursor): Header {
  const { name } = cursor;
  cursor.text();
  cursor.text();
  const [durationSeconds, splats, cutoff, model] = [cursor.f64(), cursor.u64(), cursor.f64(), cursor.text()];
  cursor.numbers(6);
  const degree = cursor.u8();
  if (!MODELS.includes(model))
    throw damaged(name, `a temporal model of ${MODELS.join(' and ')}`, quote(model), 'decode/unsupported');
  if (!(durationSeconds >= 0 && (durationSeconds < 1e6 || durationSeconds === Infinity)))
    throw damaged(name, 'a duration of 0 to a million seconds', String(durationSeconds), 'decode/header');
  if (!(cutoff > 0 && cutoff <= 1)) throw damaged(name, 'a cutoff of 0 to 1', String(cutoff), 'decode/header');
  if (degree > 3) throw damaged(name, 'spherical harmonics of degree 0 to 3', `degree ${degree}`, 'decode/unsupported');
  return { durationSeconds, splats, cutoff, model: model as TemporalModel, shDegree: degree as ShDegree };
}

/**
 * Quantization of attributes: the origin of positions, and the step of each attribute. Steps of `scaleLog` and `sigmaLog`
 * are in natural logarithms, `time` is in seconds, and `motion` in units per second.
 */
export interface Grids {
  readonly origin: Vector3;
  readonly position: number;
  readonly scaleLog: number;
  readonly rotation: number;
  readonly color: number;
  readonly opacity: number;
  readonly motion: number;
  readonly time: number;
  readonly sigmaLog: number;
}

export function readGrids(cursor: Cursor): Grids {
  const { name } = cursor;
  const scheme = cursor.text();
  if (scheme !== 'uniform-v1')
    throw damaged(name, 'the quantization scheme "uniform-v1"', quote(scheme), 'decode/unsupported');
  const numbers = cursor.numbers(11);
  if (!numbers.every(Number.isFinite)) throw damaged(name, 'finite steps of quantization', 'others');
  const [x, y, z, position, scaleLog, rotation, color, opacity, motion, time, sigmaLog] = numbers;
  if (!(time > 0)) throw damaged(name, 'a step of time above 0', String(time));
  return { origin: [x, y, z], position, scaleLog, rotation, color, opacity, motion, time, sigmaLog };
}

/** Reads the ranges of time [from, until] in seconds. The attribute `window` of a splat is an index of these ranges. */
export function readWindows(cursor: Cursor): (readonly [number, number])[] {
  const count = cursor.u32();
  if (16 * count > cursor.left)
    throw damaged(cursor.name, `${grouped(count)} windows`, `${grouped(cursor.left)} bytes`, 'decode/truncated');
  return Array.from({ length: count }, () => [cursor.f64(), cursor.f64()] as const);
}

const AXES: readonly Vector3[] = [
  ...([[1, 0, 0], [0, 1, 0], [0, 0, 1]] as const),
  ...([[-1, 0, 0], [0, -1, 0], [0, 0, -1]] as const),
]; // prettier-ignore

/** Returns the direction up in the scene's coordinates; undefined if the record describes another coordinate frame. */
export function readUp(cursor: Cursor): Vector3 | undefined {
  const isOwn = cursor.text() === '';
  cursor.u8();
  const [up, forward] = [cursor.u8(), cursor.u8()];
  if (up % 3 === forward % 3)
    throw damaged(cursor.name, 'axes up and forward that differ', `${up} and ${forward}`, 'decode/header');
  return isOwn ? AXES[up] : undefined;
}
