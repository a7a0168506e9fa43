import { GaussianSplatError, type ShDegree } from '@gaussian-splat/core';
import { grouped, viewOf } from '../bytes.js';
import { damaged, noSplatsAt } from '../faults.js';
import { KSPLAT_HEADER_BYTES as HEADER_BYTES } from '../signatures.js';

const SECTION_HEADER_BYTES = 1024;

/** Bytes of a coordinate, scale or quaternion component, and of a coefficient, by compression level. */
const LEVELS = [
  { number: 4, coefficient: 4 },
  { number: 2, coefficient: 2 },
  { number: 2, coefficient: 1 },
] as const;

/** Default range of the 16-bit offsets of positions in levels 1 and 2. A section may declare another. */
const DEFAULT_RANGE = 32_767;
const COEFFICIENTS = [0, 9, 24, 45];

/** A section of a file. Its positions are relative to the centers of buckets, which are cubes. */
export interface KsplatSection {
  readonly count: number;
  readonly degree: ShDegree;
  readonly bytesPerSplat: number;
  /** Byte offset in the file of the first splat. */
  readonly splatsAt: number;
  /** Byte offset in the file of the first bucket's center, three float32. */
  readonly bucketsAt: number;
  readonly bucketStride: number;
  readonly bucketCount: number;
  /** Number of splats of each full bucket. Full buckets precede the partial ones. */
  readonly bucketSize: number;
  readonly fullBuckets: number;
  /** Byte offset in the file of the number of splats of each partial bucket, uint32. */
  readonly partialSizesAt: number;
  readonly partialBuckets: number;
  /** Units of the scene for one step of a position. */
  readonly positionStep: number;
  /** Stored coordinate of the center of a bucket, in steps. */
  readonly positionRange: number;
}

export interface KsplatHeader {
  readonly level: 0 | 1 | 2;
  /** Number of splats of all sections. */
  readonly count: number;
  /** Highest degree of spherical harmonics of all sections. */
  readonly degree: ShDegree;
  /** Values of coefficients that the bytes 0 and 255 represent in level 2. */
  readonly coefficientRange: readonly [number, number];
  readonly sections: readonly KsplatSection[];
}

/**
 * Parses and validates the header of a file and the headers of its sections.
 * @param isPrefix Whether `bytes` is only the beginning of the file. Sections are then shortened to their complete
 * splats.
 * @throws GaussianSplatError `decode/truncated`, `decode/header`, `decode/unsupported`, `decode/empty`
 */
export function parseKsplatHeader(bytes: Uint8Array, name: string, isPrefix = false): KsplatHeader {
  if (bytes.length < HEADER_BYTES) throw cut(bytes, name, HEADER_BYTES, 'a header');
  const view = viewOf(bytes);
  const where = (byte: number): string => `${name}, byte ${grouped(byte)} of the .ksplat header`;
  const [major, minor] = [bytes[0], bytes[1]];
  if (major !== 0 || minor < 1) throw damaged(where(0), 'version 0.1', `${major}.${minor}`, 'decode/unsupported');
  const level = view.getUint16(20, true);
  if (level > 2) throw damaged(where(20), 'a compression level from 0 to 2', String(level), 'decode/header');
  const sections = parseSections(bytes, name, level as KsplatHeader['level']).map((section) =>
    isPrefix ? shortened(section, bytes.length) : section,
  );
  if (!isPrefix) sections.forEach((section) => requireRoom(section, bytes, name));
  const count = sections.reduce((sum, section) => sum + section.count, 0);
  if (count === 0) throw noSplatsAt(where(16));
  const range = [36, 40].map((at) => view.getFloat32(at, true)) as [number, number];
  if (range.some((end) => !Number.isFinite(end)))
    throw damaged(where(36), 'a range of coefficients', 'numbers that are not finite', 'decode/header');
  const degree = sections.reduce<ShDegree>((max, own) => (own.degree > max ? own.degree : max), 0);
  return {
    level: level as KsplatHeader['level'],
    count,
    degree,
    coefficientRange: [range[0] || -1.5, range[1] || 1.5],
    sections,
  };
}

function parseSections(bytes: Uint8Array, name: string, level: 0 | 1 | 2): KsplatSection[] {
  const view = viewOf(bytes);
  // The number of used sections at byte 8 is unreliable: GaussianSplats3D ignores it, and some files contain 0.
  const maxSections = view.getUint32(4, true);
  const dataStart = HEADER_BYTES + SECTION_HEADER_BYTES * maxSections;
  if (dataStart > bytes.length) throw cut(bytes, name, dataStart, `${grouped(maxSections)} section headers`);
  const sections: KsplatSection[] = [];
  let at = dataStart;
  for (let k = 0; k < maxSections; k++) {
    const { section, end } = parseSection(bytes, name, HEADER_BYTES + SECTION_HEADER_BYTES * k, at, level);
    sections.push(section);
    at = end;
  }
  return sections;
}

function parseSection(
  bytes: Uint8Array,
  name: string,
  header: number,
  start: number,
  level: 0 | 1 | 2,
): { section: KsplatSection; end: number } {
  const view = viewOf(bytes);
  const word = (offset: number): number => view.getUint32(header + offset, true);
  const where = `${name}, byte ${grouped(header)}, a .ksplat section header`;
  const [count, maxCount, bucketSize, bucketCount] = [word(0), word(4), word(8), word(12)];
  const bucketStride = view.getUint16(header + 20, true);
  const [fullBuckets, partialBuckets] = [word(32), word(36)];
  const degree = view.getUint16(header + 40, true);
  if (degree > 3) throw damaged(where, 'a degree of spherical harmonics from 0 to 3', String(degree), 'decode/header');
  if (count > maxCount) throw damaged(where, `at most ${grouped(maxCount)} splats`, grouped(count), 'decode/header');
  if (level > 0 && (fullBuckets + partialBuckets > bucketCount || (bucketCount > 0 && bucketStride < 12))) {
    const found = `${grouped(fullBuckets)} full and ${grouped(partialBuckets)} other buckets of ${bucketStride} bytes`;
    throw damaged(where, `${grouped(bucketCount)} buckets of 12 bytes or more`, found, 'decode/header');
  }
  const { number, coefficient } = LEVELS[level];
  const bytesPerSplat = 10 * number + 4 + COEFFICIENTS[degree] * coefficient;
  const bucketsAt = start + 4 * partialBuckets;
  const splatsAt = bucketsAt + bucketStride * bucketCount;
  const end = splatsAt + bytesPerSplat * maxCount;
  const positionRange = word(24) || DEFAULT_RANGE;
  const positionStep = view.getFloat32(header + 16, true) / 2 / positionRange;
  const section = {
    ...{ count, degree: degree as ShDegree, bytesPerSplat, splatsAt, bucketsAt, bucketStride, bucketCount, bucketSize },
    ...{ fullBuckets, partialSizesAt: start, partialBuckets, positionStep, positionRange },
  };
  return { section, end };
}

function requireRoom({ count, splatsAt, bytesPerSplat }: KsplatSection, bytes: Uint8Array, name: string): void {
  const end = splatsAt + bytesPerSplat * count;
  if (end > bytes.length) throw cut(bytes, name, end, `${grouped(count)} splats of ${bytesPerSplat} bytes`);
}

function shortened(section: KsplatSection, fileBytes: number): KsplatSection {
  const count = Math.floor((fileBytes - section.splatsAt) / section.bytesPerSplat);
  return { ...section, count: Math.max(0, Math.min(section.count, count)) };
}

function cut(bytes: Uint8Array, name: string, needed: number, what: string): GaussianSplatError {
  return new GaussianSplatError('decode/truncated', {
    where: `${name}, byte ${grouped(bytes.length)} (end of the file)`,
    expected: `${what}, which end at byte ${grouped(needed)}`,
    found: `${grouped(bytes.length)} bytes`,
    remedy: 'download or export the file again; it is incomplete or its header is damaged',
  });
}
