import { GaussianSplatError, loadModule, type GaussianCloud } from '@gaussian-splat/core';
import { startsWith } from '../bytes.js';
import { PREVIEW_STEP, sparse } from '../preview.js';
import { previewWanted, type SceneSource } from '../scene-format.js';
import { Gunzip } from '../spz/gunzip.js';
import {
  bodyBytes,
  bytesPerSplat,
  parseSpzHeader,
  requirePlausibleCount,
  SPZ_ATTRIBUTES,
  SPZ_HEADER_BYTES,
  truncatedHeader,
  type SpzHeader,
} from '../spz/header.js';
import { longestBody, readLegacyBody } from '../spz/legacy.js';
import type * as streams from '../spz/streams.js';
import type { PackedScene } from '../spz/streams.js';
import { unpackSplats } from '../spz/unpack.js';

/**
 * Reads Niantic's SPZ: versions 1 to 3, which are gzip files (or their inflated content), and version 4, whose
 * attributes are zstd streams. Degree 4 of the spherical harmonics is left out. Extensions are skipped, save the one
 * that names the coordinate system; without it a file is in right-up-back and is turned into a cloud's frame.
 */
export async function readSpz(source: SceneSource): Promise<GaussianCloud> {
  if (source.isPrefix) return readWithoutHarmonics(source);
  const { header, scene } = startsWith(source.bytes, 'NGSP') ? await readPlain(source) : await readGzip(source);
  source.signal?.throwIfAborted();
  if (previewWanted(source, header.count)) await source.onPreview?.(previewOf(header, scene, source));
  return unpackSplats(header, scene, source);
}

/** Every so many-th splat, without coefficients above the constant one. */
function previewOf(header: SpzHeader, { attributes, axes }: PackedScene, source: SceneSource): GaussianCloud {
  const sizes = bytesPerSplat(header.version, 0);
  const count = Math.ceil(header.count / PREVIEW_STEP);
  const taken = Object.fromEntries(
    SPZ_ATTRIBUTES.map((attribute) => [attribute, everyNth(attributes[attribute], sizes[attribute], count)]),
  ) as PackedScene['attributes'];
  return sparse(unpackSplats({ ...header, count, degree: 0 }, { attributes: taken, axes }, source));
}

function everyNth(values: Uint8Array, size: number, count: number): Uint8Array {
  const taken = new Uint8Array(size * count);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < size; k++) taken[size * i + k] = values[size * PREVIEW_STEP * i + k];
  }
  return taken;
}

/** The harmonics come last and are half of a file and more: all splats are there long before its end. */
async function readWithoutHarmonics(source: SceneSource): Promise<GaussianCloud> {
  const { bytes, name } = source;
  if (startsWith(bytes, 'NGSP')) {
    const header = parseSpzHeader(bytes, name);
    if (header.version === 4) {
      const plain = { ...header, degree: 0 } as const;
      requirePlausibleCount(plain, bytes.length, name);
      return unpackSplats(plain, (await loadStreams()).readStreams(source, header), source);
    }
    return unpackLegacy(source, bytes, header);
  }
  const gunzip = new Gunzip(source);
  try {
    const header = parseSpzHeader(await gunzip.upTo(SPZ_HEADER_BYTES), name);
    const plain = { ...header, degree: 0 } as const;
    // More than the bytes so far can hold is not there yet, or never will be.
    requirePlausibleCount(plain, bytes.length, name);
    const length = SPZ_HEADER_BYTES + bodyBytes(plain, header.version);
    return unpackLegacy(source, await gunzip.upTo(length), header);
  } finally {
    gunzip.close();
  }
}

function unpackLegacy(source: SceneSource, file: Uint8Array, header: SpzHeader): GaussianCloud {
  const plain = { ...header, degree: 0, hasExtensions: false } as const;
  const body = file.subarray(0, SPZ_HEADER_BYTES + bodyBytes(plain, header.version));
  return unpackSplats(plain, readLegacyBody(body, plain, source.name), source);
}

interface SpzParts {
  readonly header: SpzHeader;
  readonly scene: PackedScene;
}

/** The decoder of zstd, which version 4 alone needs, is half of the code that reads SPZ. */
const loadStreams = (): Promise<typeof streams> =>
  loadModule('the code that reads SPZ version 4', () => import('../spz/streams.js'));

async function readPlain(source: SceneSource): Promise<SpzParts> {
  const { bytes, name } = source;
  const header = parseSpzHeader(bytes, name);
  requirePlausibleCount(header, bytes.length, name);
  const scene =
    header.version === 4 ? (await loadStreams()).readStreams(source, header) : readLegacyBody(bytes, header, name);
  return { header, scene };
}

async function readGzip(source: SceneSource): Promise<SpzParts> {
  const { bytes, name } = source;
  const gunzip = new Gunzip(source);
  try {
    const start = await gunzip.upTo(SPZ_HEADER_BYTES);
    if (start.length < SPZ_HEADER_BYTES && startsWith(start, 'NGSP')) {
      throw truncatedHeader(name, start.length, SPZ_HEADER_BYTES);
    }
    if (!startsWith(start, 'NGSP')) throw await otherGzip(start, name);
    const header = parseSpzHeader(start, name);
    if (header.version === 4) throw gzippedVersion4(name);
    requirePlausibleCount(header, bytes.length, name);
    const file = await gunzip.upTo(SPZ_HEADER_BYTES + longestBody(header));
    return { header, scene: readLegacyBody(file, header, name) };
  } finally {
    gunzip.close();
  }
}

async function otherGzip(start: Uint8Array, name: string): Promise<GaussianSplatError> {
  const { describeContent } = await loadModule('the code that names files', () => import('../diagnose.js'));
  return new GaussianSplatError('decode/unknown-format', {
    where: `${name}, byte 0 inside the gzip file`,
    expected: 'an SPZ scene (the letters NGSP)',
    found: describeContent(start),
    remedy: 'decompress the file first, or have the server send it with "Content-Encoding: gzip"',
  });
}

function gzippedVersion4(name: string): GaussianSplatError {
  return new GaussianSplatError('decode/unsupported', {
    where: `${name}, byte 4 of the SPZ header`,
    expected: 'version 1, 2 or 3 inside a gzip file',
    found: 'version 4, which is not compressed as a whole',
    remedy: 'decompress the file first, or have the server send it with "Content-Encoding: gzip"',
  });
}
