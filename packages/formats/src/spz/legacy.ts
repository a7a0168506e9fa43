import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { axesOfExtensions } from './axes.js';
import {
  bodyBytes,
  bytesPerSplat,
  SPZ_ATTRIBUTES,
  SPZ_HEADER_BYTES,
  type SpzAttribute,
  type SpzHeader,
} from './header.js';
import type { PackedScene } from './streams.js';

/** Extension records after the splats are read up to this size; the known ones have 12 to 20 bytes. */
export const MAX_EXTENSION_BYTES = 65_536;

const VERSIONS = [1, 2, 3];

/**
 * Most bytes that a body can have under this header in any version, extensions and one byte too many included: what
 * must be inflated to tell a wrong version from a wrong length.
 */
export function longestBody(header: SpzHeader): number {
  const longest = Math.max(...VERSIONS.map((version) => bodyBytes(header, version)));
  return longest + (header.hasExtensions ? MAX_EXTENSION_BYTES : 1);
}

/**
 * Reads the body of versions 1 to 3: the attributes of all splats, one after another, then extension records. Its
 * length must be exactly what the header announces; files whose header names another version than the body has would
 * otherwise show garbage.
 *
 * @param file the inflated file, or as much as {@link longestBody} asks for.
 */
export function readLegacyBody(file: Uint8Array, header: SpzHeader, name: string): PackedScene {
  const expected = bodyBytes(header, header.version);
  const present = file.length - SPZ_HEADER_BYTES;
  if (present < expected || (present > expected && !header.hasExtensions)) throw wrongLength(header, present, name);
  const sizes = bytesPerSplat(header.version, header.degree);
  const attributes = {} as Record<SpzAttribute, Uint8Array>;
  let at = SPZ_HEADER_BYTES;
  for (const attribute of SPZ_ATTRIBUTES) {
    const end = at + header.count * sizes[attribute];
    attributes[attribute] = file.subarray(at, end);
    at = end;
  }
  return { attributes, axes: axesOfExtensions(header.hasExtensions ? file.subarray(at) : new Uint8Array(0), name) };
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
