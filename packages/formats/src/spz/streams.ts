import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped, viewOf } from '../bytes.js';
import type { SceneSource } from '../scene-format.js';
import { ZstdError } from '../zstd/bits.js';
import { decompressZstd } from '../zstd/decompress.js';
import { readExtensions, type SpzFrame } from './axes.js';
import { bytesPerSplat, SPZ_ATTRIBUTES, truncatedHeader, type SpzAttribute, type SpzHeader } from './header.js';

/** Packed attributes of all splats, uncompressed, and their coordinate system. */
export interface PackedScene extends SpzFrame {
  readonly attributes: Readonly<Record<SpzAttribute, Uint8Array>>;
  /** Types of unknown extension records. */
  readonly skipped?: readonly number[];
}

const HEADER_BYTES = 32;
const ENTRY_BYTES = 16;

/**
 * Reads the body of version 4: uncompressed extension records, a table of the compressed and uncompressed sizes of the
 * streams, and one zstd stream for each attribute that has bytes. If the file is a prefix, coefficients are skipped.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`, `decode/corrupt`, `decode/unsupported`,
 * `out-of-memory/budget`
 */
export function readStreams(source: SceneSource, header: SpzHeader): PackedScene {
  const { bytes, name } = source;
  if (bytes.length < HEADER_BYTES) throw truncatedHeader(name, bytes.length, HEADER_BYTES);
  const sizes = bytesPerSplat(header.version, header.degree);
  const present = SPZ_ATTRIBUTES.filter((attribute) => sizes[attribute] > 0);
  const wanted = source.isPrefix ? present.filter((attribute) => attribute !== 'harmonics') : present;
  const view = viewOf(bytes);
  const streamCount = bytes[15];
  const tableStart = view.getUint32(16, true);
  const tableEnd = tableStart + ENTRY_BYTES * streamCount;
  if (streamCount !== present.length) {
    throw contradiction(name, 15, `${present.length} streams for degree ${header.degree}`, String(streamCount));
  }
  if (tableStart < HEADER_BYTES) throw contradiction(name, 16, 'a table after the header', `byte ${tableStart}`);
  if (tableEnd > bytes.length) throw truncatedHeader(name, bytes.length, tableEnd);
  const attributes = { harmonics: new Uint8Array(0) } as Record<SpzAttribute, Uint8Array>;
  let at = tableEnd;
  wanted.forEach((attribute, k) => {
    source.signal?.throwIfAborted();
    const entry = tableStart + ENTRY_BYTES * k;
    const compressed = Number(view.getBigUint64(entry, true));
    const uncompressed = Number(view.getBigUint64(entry + 8, true));
    const expected = header.count * sizes[attribute];
    if (uncompressed !== expected) {
      throw contradiction(name, entry + 8, `${grouped(expected)} bytes of ${attribute}`, grouped(uncompressed));
    }
    if (at + compressed > bytes.length) throw truncatedStream(source, attribute, at, compressed);
    source.budget.take(expected, name);
    attributes[attribute] = inflate(bytes.subarray(at, at + compressed), expected, attribute, at, name);
    at += compressed;
  });
  const records = header.hasExtensions ? bytes.subarray(HEADER_BYTES, tableStart) : new Uint8Array(0);
  return { attributes, ...readExtensions(records, header, name) };
}

function inflate(stream: Uint8Array, length: number, attribute: string, at: number, name: string): Uint8Array {
  try {
    return decompressZstd(stream, length);
  } catch (cause) {
    if (!(cause instanceof ZstdError)) throw cause;
    throw new GaussianSplatError(cause.isCut ? 'decode/truncated' : 'decode/corrupt', {
      where: `${name}, byte ${grouped(at + cause.byte)}, zstd stream of ${attribute}`,
      expected: `an intact stream of ${grouped(length)} bytes`,
      found: cause.message,
      remedy: 'download or export the file again; it is incomplete',
      cause,
    });
  }
}

function contradiction(name: string, byte: number, expected: string, found: string): GaussianSplatError {
  return new GaussianSplatError('decode/header', {
    where: `${name}, byte ${byte} of the SPZ header`,
    expected,
    found,
    remedy: 'export the file again; its header contradicts itself',
  });
}

function truncatedStream(source: SceneSource, attribute: string, at: number, length: number): GaussianSplatError {
  const { bytes, name } = source;
  return new GaussianSplatError('decode/truncated', {
    where: `${name}, byte ${grouped(bytes.length)} (end of the file)`,
    expected: `${grouped(length)} bytes of ${attribute} from byte ${grouped(at)} on`,
    found: `${grouped(bytes.length - at)}`,
    remedy: 'download or export the file again; it is incomplete',
  });
}
