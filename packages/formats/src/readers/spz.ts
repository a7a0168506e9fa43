import { GaussianSplatError, loadModule, type GaussianCloud } from '@gaussian-splat/core';
import { startsWith } from '../bytes.js';
import type { DraftCloud } from '../cloud.js';
import { warn } from '../faults.js';
import { loadDetection, loadReader } from '../load-files.js';
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
 * Reads Niantic's SPZ: versions 1 to 3, which are gzip files or their inflated content, and version 4, whose attributes
 * are zstd streams. Degree 4 of the spherical harmonics is dropped. Extensions are skipped, except the one for the
 * coordinate system; without it, `assumedAxes` infers the axes from the program that wrote the file.
 */
export async function readSpz(source: SceneSource): Promise<GaussianCloud> {
  if (source.isPrefix) return readWithoutHarmonics(source);
  const found = startsWith(source.bytes, 'NGSP') ? await readPlain(source) : await readGzip(source);
  if ('positions' in found) return found;
  const { header, scene } = found;
  source.signal?.throwIfAborted();
  if (previewWanted(source, header.count)) await source.onPreview?.(await previewOf(header, scene, source));
  const cloud: DraftCloud = await unpackFrame(header, scene, source);
  if (cloud.hints?.isUpAssumed) warn(cloud, ASSUMED_AXES);
  return cloud;
}

const ASSUMED_AXES =
  'The file does not name its axes, which are inferred from the marks of its writer. If the scene stands on its head, set up="y".';

/** Unpacks all attributes into the coordinates of a cloud. Few files have a vertical third axis and need a rotation. */
async function unpackFrame(header: SpzHeader, scene: PackedScene, source: SceneSource): Promise<GaussianCloud> {
  const cloud = unpackSplats(header, scene, source);
  if (scene.turn === undefined) return cloud;
  const { transformCloud } = await loadModule(
    'the code that turns splats',
    () => import('../transform/transform-cloud.js'),
  );
  transformCloud(cloud, scene.turn);
  return cloud;
}

/**
 * Parses the header, and adds the marks outside of it: the system of the gzip file, and whether the axes are those of the
 * specification (right, up, back), as within glTF.
 */
const headerOf = ({ name, bytes, isWithinGltf }: SceneSource, start: Uint8Array): SpzHeader => ({
  ...parseSpzHeader(start, name),
  gzipSystem: bytes[0] === 0x1f ? bytes[9] : undefined,
  followsSpecification: isWithinGltf,
});

/** Unpacks every {@link PREVIEW_STEP}-th splat, enlarged, without coefficients above the constant one. */
async function previewOf(
  header: SpzHeader,
  { attributes, axes, turn }: PackedScene,
  source: SceneSource,
): Promise<GaussianCloud> {
  const sizes = bytesPerSplat(header.version, 0);
  const count = Math.ceil(header.count / PREVIEW_STEP);
  const taken = Object.fromEntries(
    SPZ_ATTRIBUTES.map((attribute) => [attribute, everyNth(attributes[attribute], sizes[attribute], count)]),
  ) as PackedScene['attributes'];
  return sparse(await unpackFrame({ ...header, count, degree: 0 }, { attributes: taken, axes, turn }, source));
}

function everyNth(values: Uint8Array, size: number, count: number): Uint8Array {
  const taken = new Uint8Array(size * count);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < size; k++) taken[size * i + k] = values[size * PREVIEW_STEP * i + k];
  }
  return taken;
}

/**
 * Reads all splats of an incomplete file without view-dependent color. Its coefficients are at the end, and are at least
 * half of a file, so that all splats are available early.
 */
async function readWithoutHarmonics(source: SceneSource): Promise<GaussianCloud> {
  const { bytes, name } = source;
  if (startsWith(bytes, 'NGSP')) {
    const header = headerOf(source, bytes);
    if (header.version === 4) {
      const plain = { ...header, degree: 0 } as const;
      requirePlausibleCount(plain, bytes.length, name);
      return unpackFrame(plain, (await loadStreams()).readStreams(source, header), source);
    }
    return unpackLegacy(source, bytes, header);
  }
  const gunzip = new Gunzip(source);
  try {
    const header = headerOf(source, await gunzip.upTo(SPZ_HEADER_BYTES));
    const plain = { ...header, degree: 0 } as const;
    // The received bytes must be enough for all splats, unless the count is invalid.
    requirePlausibleCount(plain, bytes.length, name);
    const length = SPZ_HEADER_BYTES + bodyBytes(plain, header.version);
    return unpackLegacy(source, await gunzip.upTo(length), header);
  } finally {
    gunzip.close();
  }
}

function unpackLegacy(source: SceneSource, file: Uint8Array, header: SpzHeader): Promise<GaussianCloud> {
  const plain = { ...header, degree: 0 } as const;
  // The extension records follow the coefficients, so that the axes are assumed.
  const body = file.subarray(0, SPZ_HEADER_BYTES + bodyBytes(plain, header.version));
  return unpackFrame(plain, readLegacyBody(body, plain, source.name), source);
}

interface SpzParts {
  readonly header: SpzHeader;
  readonly scene: PackedScene;
}

/** Loads the reader of version 4 with its zstd decoder, which is half of the code that reads SPZ. */
const loadStreams = (): Promise<typeof streams> =>
  loadModule('the code that reads SPZ version 4', () => import('../spz/streams.js'));

async function readPlain(source: SceneSource): Promise<SpzParts> {
  const { bytes, name } = source;
  const header = headerOf(source, bytes);
  requirePlausibleCount(header, bytes.length, name);
  const scene =
    header.version === 4 ? (await loadStreams()).readStreams(source, header) : readLegacyBody(bytes, header, name);
  return { header, scene };
}

/** Reads the sections of an SPZ in a gzip file, or the splats of another scene in it. */
async function readGzip(source: SceneSource): Promise<SpzParts | GaussianCloud> {
  const { bytes, name } = source;
  const gunzip = new Gunzip(source);
  try {
    const start = await gunzip.upTo(SPZ_HEADER_BYTES);
    if (start.length < SPZ_HEADER_BYTES && startsWith(start, 'NGSP')) {
      throw truncatedHeader(name, start.length, SPZ_HEADER_BYTES);
    }
    if (!startsWith(start, 'NGSP')) return await readInflated(source, start, gunzip);
    const header = headerOf(source, start);
    if (header.version === 4) throw gzippedVersion4(name);
    requirePlausibleCount(header, bytes.length, name);
    const file = await gunzip.upTo(SPZ_HEADER_BYTES + longestBody(header));
    return { header, scene: readLegacyBody(file, header, name) };
  } finally {
    gunzip.close();
  }
}

/** Reads a scene of another format in a gzip file, such as `scene.ply.gz`. @param start First inflated bytes. */
async function readInflated(source: SceneSource, start: Uint8Array, gunzip: Gunzip): Promise<GaussianCloud> {
  const { findFormat } = await loadDetection();
  const name = source.name.replace(/\.gz$/i, '');
  const isOther = (bytes: Uint8Array): boolean => (findFormat(bytes, name, '')?.name ?? 'spz') !== 'spz';
  // Inflation ends here if the content does not begin as a scene.
  if (!isOther(start)) throw await otherGzip(start, source.name);
  let bytes = start;
  for (let length = 0; bytes.length > length;) {
    length = bytes.length;
    bytes = await gunzip.upTo(2 * Math.max(length, SPZ_HEADER_BYTES));
  }
  const format = findFormat(bytes, name, '')!;
  const read = await loadReader(format);
  source.signal?.throwIfAborted();
  return read({ ...source, bytes: bytes.slice(), name });
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
