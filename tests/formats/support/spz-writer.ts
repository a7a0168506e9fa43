/** Packs splats into SPZ files of every version, following the description of the format and not the reader. */
import { gzipSync } from 'node:zlib';
import type { RawSplats } from './splats.js';

export interface SpzWriterOptions {
  readonly version: 1 | 2 | 3 | 4;
  readonly antialiased?: boolean;
  /** Extension records, already encoded. */
  readonly extensions?: Uint8Array;
  readonly fractionalBits?: number;
  /** Axes of the file relative to x right, y down, z forward; default: {@link usualAxes}. */
  readonly axes?: readonly [number, number, number];
}

/** The frame that tools write without naming it: Niantic's apps (versions 1 and 2) and tools with other fractional bits right-up-back, converters the frame of PLY. */
export function usualAxes({
  version,
  antialiased,
  fractionalBits = 12,
}: SpzWriterOptions): NonNullable<SpzWriterOptions['axes']> {
  const isNative = version === 1 || (version === 2 && antialiased === true);
  return isNative || fractionalBits !== 12 ? [1, -1, -1] : [1, 1, 1];
}

const clampByte = (value: number): number => Math.min(255, Math.max(0, Math.round(value)));

/** The inflated content of versions 1 to 3. */
export function spzBody(splats: RawSplats, options: SpzWriterOptions): Uint8Array {
  return new Uint8Array(
    Buffer.concat([
      headerOf(splats, options, 0),
      ...streamsOf(splats, options),
      options.extensions ?? new Uint8Array(0),
    ]),
  );
}

/** A whole file: gzip for versions 1 to 3, streams of uncompressed zstd blocks for version 4. */
export function writeSpz(splats: RawSplats, options: SpzWriterOptions): Uint8Array {
  if (options.version < 4) return new Uint8Array(gzipSync(spzBody(splats, options)));
  const streams = streamsOf(splats, options).filter((stream) => stream.length > 0);
  return spzContainer(headerOf(splats, options, streams.length), streams.map(storeZstd), streams, options.extensions);
}

/** A version 4 file out of a 16-byte header and streams, compressed by the caller. */
export function spzContainer(
  header: Uint8Array,
  compressed: readonly Uint8Array[],
  uncompressed: readonly { readonly length: number }[],
  extensions: Uint8Array = new Uint8Array(0),
): Uint8Array {
  const rest = Buffer.alloc(16);
  rest.writeUInt32LE(32 + extensions.length, 0);
  const table = Buffer.alloc(16 * compressed.length);
  compressed.forEach((stream, k) => {
    table.writeBigUInt64LE(BigInt(stream.length), 16 * k);
    table.writeBigUInt64LE(BigInt(uncompressed[k].length), 16 * k + 8);
  });
  return new Uint8Array(Buffer.concat([header, rest, extensions, table, ...compressed]));
}

/** A zstd frame that holds bytes uncompressed, in blocks of up to 128 KiB. */
export function storeZstd(bytes: Uint8Array): Uint8Array {
  const header = Buffer.from([0x28, 0xb5, 0x2f, 0xfd, 0xa0, 0, 0, 0, 0]);
  header.writeUInt32LE(bytes.length, 5);
  const parts: Uint8Array[] = [header];
  for (let at = 0; at < bytes.length || at === 0; at += 131_072) {
    const content = bytes.subarray(at, at + 131_072);
    const isLast = at + 131_072 >= bytes.length;
    const block = Buffer.alloc(3);
    block.writeUIntLE((content.length << 3) | Number(isLast), 0, 3);
    parts.push(block, content);
  }
  return new Uint8Array(Buffer.concat(parts));
}

/** One extension record. */
export function extensionRecord(type: number, payload: Uint8Array): Uint8Array {
  const head = Buffer.alloc(8);
  head.writeUInt32LE(type, 0);
  head.writeUInt32LE(payload.length, 4);
  return new Uint8Array(Buffer.concat([head, payload]));
}

export function headerOf(splats: RawSplats, options: SpzWriterOptions, streamCount: number): Uint8Array {
  const { version, antialiased, extensions, fractionalBits = 12 } = options;
  const header = Buffer.alloc(16);
  header.write('NGSP', 'latin1');
  header.writeUInt32LE(version, 4);
  header.writeUInt32LE(splats.count, 8);
  header[12] = splats.degree;
  header[13] = fractionalBits;
  header[14] = (antialiased ? 1 : 0) | (extensions ? 2 : 0);
  header[15] = streamCount;
  return new Uint8Array(header);
}

/** Positions, opacities, colors, scales, rotations and harmonics, in the order of the file. */
function streamsOf(splats: RawSplats, options: SpzWriterOptions): Uint8Array[] {
  const { version, fractionalBits = 12, axes = usualAxes(options) } = options;
  const bytes = (values: readonly number[]): Uint8Array => Uint8Array.from(values);
  const coordinates = splats.positions.flatMap((p) => p.map((value, axis) => value * axes[axis]));
  const fixed = coordinates.flatMap((value) => {
    const units = Math.round(value * 2 ** fractionalBits);
    return [units & 255, (units >> 8) & 255, (units >> 16) & 255];
  });
  const turned = splats.rotations.map(([w, x, y, z]) => [
    x * axes[1] * axes[2],
    y * axes[0] * axes[2],
    z * axes[0] * axes[1],
    w,
  ]);
  return [
    version === 1 ? halfFloats(coordinates) : bytes(fixed),
    bytes(splats.logits.map((logit) => clampByte(255 / (1 + Math.exp(-logit))))),
    bytes(splats.sh.flatMap((s) => s[0].map((value) => clampByte(255 * (0.5 + 0.15 * value))))),
    bytes(splats.logScales.flat().map((value) => clampByte(16 * (value + 10)))),
    version >= 3 ? smallestThree(turned) : bytes(turned.flatMap((q) => firstThree(q))),
    bytes(
      splats.sh.flatMap((s) =>
        s.slice(1).flatMap((c, k) => c.map((value) => clampByte(128 + 128 * value * signOf(k, axes)))),
      ),
    ),
  ];
}

/** Powers of x, y and z, modulo 2, in the polynomials of degrees 1 to 3, whose parity is the sign under mirroring. */
const POWERS = ['y', 'z', 'x', 'xy', 'yz', '', 'xz', '', 'y', 'xyz', 'y', 'z', 'x', 'z', 'x'];

function signOf(k: number, axes: readonly [number, number, number]): number {
  const powers = POWERS[k] ?? '';
  return [...'xyz'].reduce((sign, axis, i) => (powers.includes(axis) ? sign * axes[i] : sign), 1);
}

function firstThree(q: readonly number[]): number[] {
  const sign = q[3] < 0 ? -1 : 1;
  return q.slice(0, 3).map((value) => clampByte(127.5 + 127.5 * sign * value));
}

function smallestThree(rotations: readonly (readonly number[])[]): Uint8Array {
  const words = rotations.map((q) => {
    const largest = q.reduce((best, value, k) => (Math.abs(value) > Math.abs(q[best]) ? k : best), 0);
    return q.reduce((word, value, k) => {
      if (k === largest) return word;
      const isNegative = value < 0 !== q[largest] < 0;
      const magnitude = Math.min(511, Math.round(511 * Math.abs(value) * Math.SQRT2));
      return word * 1024 + (isNegative ? 512 : 0) + magnitude;
    }, largest);
  });
  return new Uint8Array(Uint32Array.from(words).buffer);
}

/** Half floats of numbers whose magnitude is in 2^-14..65504, rounded to nearest. */
function halfFloats(values: readonly number[]): Uint8Array {
  const halves = values.map((value) => {
    const magnitude = Math.abs(value);
    if (magnitude < 2 ** -14) return 0;
    const exponent = Math.floor(Math.log2(magnitude));
    const bits = (exponent + 15) * 1024 + Math.round((magnitude / 2 ** exponent - 1) * 1024);
    return bits + (value < 0 ? 0x8000 : 0);
  });
  return new Uint8Array(Uint16Array.from(halves).buffer);
}
