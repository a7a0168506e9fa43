import { GaussianSplatError, type ShDegree } from '@gaussian-splat/core';
import { grouped, startsWith, viewOf } from '../bytes.js';
import { noSplatsAt } from '../faults.js';

/** Header fields that all versions of SPZ have. */
export interface SpzHeader {
  readonly version: 1 | 2 | 3 | 4;
  readonly count: number;
  readonly degree: ShDegree | 4;
  /** Number of fractional bits of the 24-bit coordinates. */
  readonly fractionalBits: number;
  readonly antialiased: boolean;
  readonly hasExtensions: boolean;
  /** Operating system in the header of the gzip file: 3 Unix, 10 Windows, 19 macOS, 255 unknown. */
  readonly gzipSystem?: number | undefined;
  /** Whether a file that declares no coordinate system has that of the specification. */
  readonly followsSpecification?: boolean | undefined;
}

/** Attributes in the order of the file. */
export const SPZ_ATTRIBUTES = ['positions', 'opacities', 'colors', 'scales', 'rotations', 'harmonics'] as const;
export type SpzAttribute = (typeof SPZ_ATTRIBUTES)[number];

/** Size in bytes of the header of versions 1 to 3. The header of version 4 begins with the same fields. */
export const SPZ_HEADER_BYTES = 16;

const FLAG_ANTIALIASED = 1;
const FLAG_EXTENSIONS = 2;
/** Flag of Spark for a tree of levels of detail. The file then has the splats of all levels, which is not supported. */
const FLAG_LEVEL_OF_DETAIL = 0x80;

/** Maximum compression ratio of deflate. Real scenes in zstd streams do not exceed it, either. */
const MAX_COMPRESSION_RATIO = 1032;

/**
 * Parses and validates the first 16 bytes of an SPZ file, inflated if the file is gzip.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported`, `decode/truncated`
 */
export function parseSpzHeader(bytes: Uint8Array, name: string): SpzHeader {
  const fail = (code: 'decode/header' | 'decode/unsupported', byte: number, expected: string, found: string): never => {
    throw new GaussianSplatError(code, {
      where: `${name}, byte ${byte} of the SPZ header`,
      expected,
      found,
      remedy: 'export the file again as SPZ version 2, 3 or 4, or as PLY',
    });
  };
  if (!startsWith(bytes, 'NGSP')) fail('decode/header', 0, 'the letters NGSP', 'other bytes');
  if (bytes.length < SPZ_HEADER_BYTES) throw truncatedHeader(name, bytes.length, SPZ_HEADER_BYTES);
  const view = viewOf(bytes);
  const version = view.getUint32(4, true);
  const [degree, fractionalBits, flags] = [bytes[12], bytes[13], bytes[14]];
  if (version === 0) fail('decode/header', 4, 'a version from 1 to 4', '0');
  if (version > 4) fail('decode/unsupported', 4, 'a version from 1 to 4', grouped(version));
  if (degree > 4) fail('decode/header', 12, 'a degree of spherical harmonics from 0 to 4', String(degree));
  if (fractionalBits > 24) fail('decode/header', 13, 'at most 24 fractional bits', String(fractionalBits));
  if ((flags & FLAG_LEVEL_OF_DETAIL) !== 0) {
    fail('decode/unsupported', 14, 'a scene without levels of detail', "flag 0x80, Spark's tree of levels of detail");
  }
  return {
    version: version as SpzHeader['version'],
    count: view.getUint32(8, true),
    degree: degree as SpzHeader['degree'],
    fractionalBits,
    antialiased: (flags & FLAG_ANTIALIASED) !== 0,
    hasExtensions: (flags & FLAG_EXTENSIONS) !== 0,
  };
}

/** Returns the size in bytes of each attribute of a splat, in the given version and degree. */
export function bytesPerSplat(version: number, degree: number): Readonly<Record<SpzAttribute, number>> {
  return {
    positions: version === 1 ? 6 : 9,
    opacities: 1,
    colors: 3,
    scales: 3,
    rotations: version >= 3 ? 4 : 3,
    harmonics: 3 * ((degree + 1) ** 2 - 1),
  };
}

/** Returns the uncompressed size in bytes of all attributes of all splats. */
export function bodyBytes({ count, degree }: SpzHeader, version: number): number {
  return count * Object.values(bytesPerSplat(version, degree)).reduce((sum, size) => sum + size, 0);
}

/**
 * Throws `decode/empty` for a header that declares no splats, and `decode/truncated` for one that declares more than the
 * file can contain. Call it before memory is allocated.
 * @param fileBytes Compressed size of the file.
 */
export function requirePlausibleCount(header: SpzHeader, fileBytes: number, name: string): void {
  if (header.count === 0) throw noSplatsAt(`${name}, byte 8 of the SPZ header`);
  const needed = Math.ceil(bodyBytes(header, header.version) / MAX_COMPRESSION_RATIO);
  if (fileBytes >= needed) return;
  throw new GaussianSplatError('decode/truncated', {
    where: `${name}, byte ${grouped(fileBytes)} (end of the file)`,
    expected: `${grouped(header.count)} splats, which take ${grouped(needed)} bytes or more`,
    found: `${grouped(fileBytes)} bytes`,
    remedy: 'download or export the file again; it is incomplete or its header is damaged',
  });
}

export function truncatedHeader(name: string, present: number, needed: number): GaussianSplatError {
  return new GaussianSplatError('decode/truncated', {
    where: `${name}, byte ${present} (end of the file)`,
    expected: `an SPZ header of ${needed} bytes`,
    found: `${present} bytes`,
    remedy: 'download or export the file again; it is incomplete',
  });
}
