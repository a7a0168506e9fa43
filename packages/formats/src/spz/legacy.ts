import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { readExtensions } from './axes.js';
import {
  bodyBytes,
  bytesPerSplat,
  SPZ_ATTRIBUTES,
  SPZ_HEADER_BYTES,
  type SpzAttribute,
  type SpzHeader,
} from './header.js';
import type { PackedScene } from './streams.js';

/** Maximum bytes after the splats: extension records, which have 12 to 20 bytes each, and padding. */
const MAX_TRAILING_BYTES = 65_536;

const VERSIONS = [1, 2, 3];

/**
 * Returns the number of bytes of the body that must be inflated to distinguish a wrong version from a wrong length: the
 * largest body of all versions 1 to 3, trailing bytes, and one byte more.
 */
export function longestBody(header: SpzHeader): number {
  return Math.max(...VERSIONS.map((version) => bodyBytes(header, version))) + MAX_TRAILING_BYTES + 1;
}

/**
 * Splits the body of versions 1 to 3 into the attributes of all splats, which are followed by extension records. Other
 * trailing bytes are ignored, unless the length may be that of another version than the header declares.
 *
 * @param file The inflated file with its header, or its beginning with a body of {@link longestBody} bytes.
 * @throws GaussianSplatError `decode/truncated`, `decode/corrupt`, `decode/unsupported` for other coordinate systems
 */
export function readLegacyBody(file: Uint8Array, header: SpzHeader, name: string): PackedScene {
  const expected = bodyBytes(header, header.version);
  const present = file.length - SPZ_HEADER_BYTES;
  if (present < expected || (!header.hasExtensions && !isTrailing(file.subarray(SPZ_HEADER_BYTES + expected), header)))
    throw wrongLength(header, present, name);
  const sizes = bytesPerSplat(header.version, header.degree);
  const attributes = {} as Record<SpzAttribute, Uint8Array>;
  let at = SPZ_HEADER_BYTES;
  for (const attribute of SPZ_ATTRIBUTES) {
    const end = at + header.count * sizes[attribute];
    attributes[attribute] = file.subarray(at, end);
    at = end;
  }
  return { attributes, ...readExtensions(header.hasExtensions ? file.subarray(at) : new Uint8Array(0), header, name) };
}

/** Whether the bytes after a body are valid: fewer than a body of another version would have there, or only zeros. */
function isTrailing(rest: Uint8Array, header: SpzHeader): boolean {
  const own = bodyBytes(header, header.version);
  const others = VERSIONS.map((version) => bodyBytes(header, version) - own).filter((bytes) => bytes > 0);
  const isZero = rest.every((byte) => byte === 0);
  return (
    rest.length <= MAX_TRAILING_BYTES &&
    others.every((bytes) => rest.length < bytes || (isZero && rest.length !== bytes))
  );
}

function wrongLength(header: SpzHeader, present: number, name: string): GaussianSplatError {
  const expected = bodyBytes(header, header.version);
  const fitting = VERSIONS.find((version) => bodyBytes(header, version) === present);
  const isCut = present < expected && fitting === undefined;
  const found = `${present > bodyBytes(header, 3) ? 'more' : grouped(present)}${fitting ? `, the length of version ${fitting}` : ''}`;
  return new GaussianSplatError(isCut ? 'decode/truncated' : 'decode/corrupt', {
    where: `${name}, SPZ body from inflated byte ${SPZ_HEADER_BYTES} on`,
    expected: `${grouped(expected)} bytes for ${grouped(header.count)} splats of version ${header.version}`,
    found,
    remedy: fitting
      ? `write version ${fitting} into byte 4 of the inflated file, or export the scene again; the header names the wrong one`
      : 'download or export the file again; body and header do not belong together',
  });
}
