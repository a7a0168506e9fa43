import { type BitReader, cut, WebpError, window32 } from './bits.js';
import { LINK, readPrefixCode, type PrefixCode } from './prefix-code.js';

const LITERALS = 256;
const LENGTH_SYMBOLS = 24;
const DISTANCE_SYMBOLS = 40;
const CACHE_HASH = 0x1e35a7bd;
/** Bytes charged for each group in addition to the tables of its five codes. */
const GROUP_BYTES = 1024;

/** Codes of a group. The symbols of `green` are also lengths of copies, and entries of the color cache. */
type Group = readonly [green: PrefixCode, red: PrefixCode, blue: PrefixCode, alpha: PrefixCode, distance: PrefixCode];

/** Map of pixels to groups. The group of pixel (x, y) is at (x >> bits, y >> bits) of an image `width` pixels wide. */
interface GroupMap {
  readonly bits: number;
  readonly width: number;
  readonly groups: Uint32Array;
}

/** Distances of the 120 smallest distance codes in the order of RFC 9649: pairs of columns to the left and rows up. */
const NEIGHBORS: readonly number[] = [
  ...[0, 1, 1, 0, 1, 1, -1, 1, 0, 2, 2, 0, 1, 2, -1, 2, 2, 1, -2, 1, 2, 2, -2, 2, 0, 3, 3, 0, 1, 3, -1, 3, 3, 1, -3, 1],
  ...[2, 3, -2, 3, 3, 2, -3, 2, 0, 4, 4, 0, 1, 4, -1, 4, 4, 1, -4, 1, 3, 3, -3, 3, 2, 4, -2, 4, 4, 2, -4, 2, 0, 5],
  ...[3, 4, -3, 4, 4, 3, -4, 3, 5, 0, 1, 5, -1, 5, 5, 1, -5, 1, 2, 5, -2, 5, 5, 2, -5, 2, 4, 4, -4, 4, 3, 5, -3, 5],
  ...[5, 3, -5, 3, 0, 6, 6, 0, 1, 6, -1, 6, 6, 1, -6, 1, 2, 6, -2, 6, 6, 2, -6, 2, 4, 5, -4, 5, 5, 4, -5, 4, 3, 6],
  ...[-3, 6, 6, 3, -6, 3, 0, 7, 7, 0, 1, 7, -1, 7, 5, 5, -5, 5, 7, 1, -7, 1, 4, 6, -4, 6, 6, 4, -6, 4, 2, 7, -2, 7],
  ...[7, 2, -7, 2, 3, 7, -3, 7, 7, 3, -7, 3, 5, 6, -5, 6, 6, 5, -6, 5, 8, 0, 4, 7, -4, 7, 7, 4, -7, 4, 8, 1, 8, 2],
  ...[6, 6, -6, 6, 8, 3, 5, 7, -5, 7, 7, 5, -7, 5, 8, 4, 6, 7, -6, 7, 7, 6, -7, 6, 8, 5, 7, 7, -7, 7, 8, 6, 8, 7],
];

/**
 * Decodes entropy-coded pixels, [height, width]: bytes ARGB from the highest.
 * @param isMain Whether the image may use several groups of codes. Images of transforms may not.
 */
export function readPixels(bits: BitReader, width: number, height: number, isMain: boolean): Uint32Array {
  const cacheBits = bits.read(1) === 1 ? bits.read(4) : 0;
  if (cacheBits > 11) throw new WebpError('a color cache of more than 11 bits');
  const map = isMain && bits.read(1) === 1 ? readGroupMap(bits, width, height) : undefined;
  const groupCount = map ? map.groups.reduce((max, group) => Math.max(max, group), 0) + 1 : 1;
  const groups = readGroups(bits, groupCount, cacheBits);
  const pixels = new Uint32Array(width * height);
  decode(bits, pixels, width, cacheBits, groups, map);
  return pixels;
}

function readGroupMap(bits: BitReader, width: number, height: number): GroupMap {
  const mapBits = bits.read(3) + 2;
  const mapWidth = Math.ceil(width / (1 << mapBits));
  const image = readPixels(bits, mapWidth, Math.ceil(height / (1 << mapBits)), false);
  return { bits: mapBits, width: mapWidth, groups: image.map((pixel) => (pixel >>> 8) & 0xffff) };
}

function readGroups(bits: BitReader, count: number, cacheBits: number): Group[] {
  const cacheSize = cacheBits > 0 ? 1 << cacheBits : 0;
  const read = (alphabet: number): PrefixCode => {
    const code = readPrefixCode(bits, alphabet);
    bits.take(4 * code.table.length);
    return code;
  };
  return Array.from({ length: count }, (): Group => {
    bits.take(GROUP_BYTES);
    const green = read(LITERALS + LENGTH_SYMBOLS + cacheSize);
    return [green, read(LITERALS), read(LITERALS), read(LITERALS), read(DISTANCE_SYMBOLS)];
  });
}

/** Decodes all pixels into `pixels`. This is the inner loop of the decoder, so the bit position is a local variable. */
function decode(
  bits: BitReader,
  pixels: Uint32Array,
  width: number,
  cacheBits: number,
  groups: readonly Group[],
  map: GroupMap | undefined,
): void {
  const { bytes, length: end } = bits;
  const cache = new Uint32Array(cacheBits > 0 ? 1 << cacheBits : 0);
  const cacheShift = 32 - cacheBits;
  const total = pixels.length;
  let position = bits.position;
  let symbolAt = position;
  const take = ({ table, rootBits }: PrefixCode): number => {
    const ahead = window32(bytes, symbolAt);
    let entry = table[ahead & ((1 << rootBits) - 1)];
    if ((entry & LINK) !== 0) {
      entry = table[(entry >>> 8) + ((ahead >>> rootBits) & ((1 << (entry & 15)) - 1))];
      symbolAt += rootBits;
    }
    symbolAt += entry & 15;
    return entry >>> 8;
  };
  const takeBits = (count: number): number => {
    const value = window32(bytes, symbolAt) & ((1 << count) - 1);
    symbolAt += count;
    return value;
  };
  const takeCoded = (symbol: number): number => {
    if (symbol < 4) return symbol + 1;
    const extra = (symbol - 2) >> 1;
    return ((2 + (symbol & 1)) << extra) + takeBits(extra) + 1;
  };

  let group = groups[map ? map.groups[0] : 0];
  const blockMask = map ? (1 << map.bits) - 1 : 0;
  let x = 0;
  let y = 0;
  let cached = 0;
  for (let at = 0; at < total;) {
    if (symbolAt > end) throw cut();
    if (map && (x & blockMask) === 0) group = groups[map.groups[(y >> map.bits) * map.width + (x >> map.bits)]];
    const green = take(group[0]);
    if (green < LITERALS) {
      const red = take(group[1]);
      const blue = take(group[2]);
      pixels[at++] = (take(group[3]) << 24) | (red << 16) | (green << 8) | blue;
      if (++x === width) {
        x = 0;
        y++;
      }
      continue;
    }
    if (green < LITERALS + LENGTH_SYMBOLS) {
      const count = takeCoded(green - LITERALS);
      const distance = distanceOf(takeCoded(take(group[4])), width);
      if (distance > at || at + count > total) throw new WebpError('a copy from outside the image');
      for (const until = at + count; at < until; at++) pixels[at] = pixels[at - distance];
      x += count;
      while (x >= width) {
        x -= width;
        y++;
      }
      if (map && at < total) group = groups[map.groups[(y >> map.bits) * map.width + (x >> map.bits)]];
      continue;
    }
    for (; cached < at; cached++) cache[Math.imul(CACHE_HASH, pixels[cached]) >>> cacheShift] = pixels[cached];
    pixels[at++] = cache[green - LITERALS - LENGTH_SYMBOLS];
    if (++x === width) {
      x = 0;
      y++;
    }
  }
  if (symbolAt > end) throw cut();
  position = symbolAt;
  bits.position = position;
}

/** Converts a distance code to pixels, 1 or more. The codes 1 to 120 are neighbors in two dimensions. */
function distanceOf(code: number, width: number): number {
  if (code > NEIGHBORS.length / 2) return code - NEIGHBORS.length / 2;
  const k = 2 * (code - 1);
  return Math.max(1, NEIGHBORS[k] + NEIGHBORS[k + 1] * width);
}
