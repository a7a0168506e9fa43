import { GaussianSplatError, shCoefficientCount, type Credits, type GaussianCloud } from '@gaussian-splat/core';
import { upright } from '@gaussian-splat/formats';
import { fileBytes, MAX_UINT32, requireAtMost } from './file-bytes.js';
import { safeOrbitOf } from './safe-orbit.js';

/** Precision of an SPZ. */
export interface SpzOptions {
  /** Bits of each coefficient above the constant one, 2 to 8; fewer compress better. */
  readonly shBits: number;
}

const COLOR_SCALE = 0.15;
const MAX_FRACTIONAL_BITS = 20;
/** The largest 24-bit coordinate, in steps. */
const MAX_STEPS = 2 ** 23 - 1;

/**
 * Record that declares the axes of a cloud: extension 0xADBE0003, 4 bytes, system 6 (right, down, forward). Current
 * converters keep and expect this record.
 */
const FRAME = [0xadbe0003, 4, 6];
/** Type and length of the limits of an orbiting camera. */
const SAFE_ORBIT = [0xadbe0002, 12];
/**
 * Record of this project for the trained order (docs/decisions/0022-the-frame-of-spz.md): its type and its length in
 * bytes; and its values.
 */
const ORDER = [0x47530001, 4];
const ORDER_VALUES = { pixel: 1, distance: 2 };
/** Record of this project for credits: attribution and license in UTF-8, separated by a zero byte. */
const CREDITS = 0x47530002;
const FLAG_ANTIALIASED = 1;
const FLAG_EXTENSIONS = 2;

/**
 * Writes SPZ version 3 (Niantic) in the coordinates of PLY, which it declares, with the maximum number of fractional
 * bits for 24-bit coordinates. A scene with an up direction other than (0, -1, 0) is rotated.
 * @throws GaussianSplatError `argument/value` for coordinates beyond 8,388,607, and for more splats than 32 bits count;
 * `out-of-memory/allocation`
 */
export async function writeSpz(given: GaussianCloud, options: SpzOptions): Promise<Uint8Array<ArrayBuffer>> {
  const cloud = upright(given);
  const { count, shDegree, antialiased } = cloud;
  const orbit = safeOrbitOf(cloud);
  const order = cloud.hints?.order;
  const records = [
    ...FRAME,
    ...(order ? [...ORDER, ORDER_VALUES[order]] : []),
    ...creditsRecord(cloud.hints?.credits),
    ...(orbit ? [...SAFE_ORBIT, ...new Uint32Array(Float32Array.from(orbit).buffer)] : []),
  ];
  const coefficients = shCoefficientCount(shDegree) - 1;
  const fractionalBits = fractionalBitsOf(cloud);
  requireAtMost('SPZ', count, MAX_UINT32, 'splats');
  const body = fileBytes('SPZ', 16 + count * (20 + 3 * coefficients) + 4 * records.length);
  const view = new DataView(body.buffer);
  // "NGSP", version, count.
  [0x5053474e, 3, count].forEach((value, k) => view.setUint32(4 * k, value, true));
  body.set([shDegree, fractionalBits, (antialiased ? FLAG_ANTIALIASED : 0) | FLAG_EXTENSIONS, 0], 12);
  let at = 16;
  at = packPositions(cloud, 2 ** fractionalBits, body, at);
  at = packColors(cloud, body, at);
  for (const scale of cloud.scales) body[at++] = byte(16 * (Math.log(scale) + 10));
  for (let i = 0; i < count; i++, at += 4) view.setUint32(at, packRotation(cloud.rotations, 4 * i), true);
  at = packHarmonics(cloud, options.shBits, body, at);
  records.forEach((value, k) => view.setUint32(at + 4 * k, value, true));
  return gzip(body);
}

/** Returns the words of the record of credits; none without credits. Spaces pad the text to whole words. */
function creditsRecord(credits: Credits | undefined): number[] {
  if (!credits) return [];
  const text = new TextEncoder().encode(`${credits.attribution ?? ''}\0${credits.license ?? ''}`);
  const padded = new Uint8Array(text.length + (-text.length & 3)).fill(0x20);
  padded.set(text);
  return [CREDITS, padded.length, ...new Uint32Array(padded.buffer)];
}

/** Largest magnitude of coefficients that SPZ holds: of the constant one, and of all others. */
const [MAX_CONSTANT, MAX_OTHER] = [0.5 / COLOR_SCALE, 1];

/** Returns sentences about colors of a cloud that are outside the range of SPZ, which cuts them. */
export function lossesOfSpz({ count, sh, shDegree }: Pick<GaussianCloud, 'count' | 'sh' | 'shDegree'>): string[] {
  const stride = 3 * shCoefficientCount(shDegree);
  let [cut, largest] = [0, 0];
  for (let i = 0; i < count; i++) {
    let beyond = 0;
    for (let k = 0; k < stride; k++) {
      const excess = Math.abs(sh[stride * i + k]) - (k < 3 ? MAX_CONSTANT : MAX_OTHER);
      if (excess > beyond) beyond = excess;
    }
    if (beyond > 0) cut++;
    largest = Math.max(largest, beyond);
  }
  if (cut === 0) return [];
  const [some, all] = [cut, count].map((value) => value.toLocaleString('en'));
  return [
    `${some} of ${all} splats have colors outside the range of SPZ, which cuts their coefficients by up to ${largest.toFixed(2)}. PLY, GLB, SOG and USDZ hold them.`,
  ];
}

const byte = (value: number): number => Math.min(255, Math.max(0, Math.round(value)));

/**
 * Returns the maximum number of fractional bits, 0..20, with which the largest coordinate fits in 24 bits.
 * @throws GaussianSplatError `argument/value` for coordinates beyond 8,388,607, which do not fit with 0 bits.
 */
export function fractionalBitsOf({ positions, origin }: Pick<GaussianCloud, 'positions' | 'origin'>): number {
  let largest = 1e-9;
  positions.forEach((value, k) => (largest = Math.max(largest, Math.abs(value + origin[k % 3]))));
  if (largest <= MAX_STEPS) return Math.min(MAX_FRACTIONAL_BITS, Math.floor(Math.log2(MAX_STEPS / largest)));
  throw new GaussianSplatError('argument/value', {
    where: 'positions of a scene that is written as SPZ',
    expected: 'coordinates of at most 8,388,607, the range of 24 bits',
    found: String(Math.round(largest)),
    remedy: 'choose .ply or .glb, which keep scenes far from (0, 0, 0), or move the scene',
  });
}

function packPositions({ positions, origin }: GaussianCloud, unit: number, out: Uint8Array, at: number): number {
  positions.forEach((value, k) => {
    const fixed = Math.round((value + origin[k % 3]) * unit);
    out.set([fixed & 255, (fixed >> 8) & 255, (fixed >> 16) & 255], at + 3 * k);
  });
  return at + 3 * positions.length;
}

function packColors({ count, opacities, sh, shDegree }: GaussianCloud, out: Uint8Array, at: number): number {
  const stride = 3 * shCoefficientCount(shDegree);
  for (let i = 0; i < count; i++) out[at++] = byte(255 * opacities[i]);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) out[at++] = byte(255 * (0.5 + COLOR_SCALE * sh[stride * i + k]));
  }
  return at;
}

/**
 * Returns a rotation (w, x, y, z) as a u32. The two highest bits are the index of the largest component of (x, y, z, w).
 * A sign bit and nine bits of magnitude follow for each other component.
 */
function packRotation(rotations: Float32Array, at: number): number {
  const q = [1, 2, 3, 0].map((k) => rotations[at + k]);
  const largest = q.reduce((best, value, k) => (Math.abs(value) > Math.abs(q[best]) ? k : best), 0);
  const flip = q[largest] < 0;
  let word = largest;
  for (let k = 0; k < 4; k++) {
    if (k === largest) continue;
    const isNegative = q[k] < 0 !== flip;
    const magnitude = Math.min(511, Math.round(511 * Math.SQRT2 * Math.abs(q[k])));
    word = (word << 10) | (isNegative ? 512 : 0) | magnitude;
  }
  return word >>> 0;
}

function packHarmonics({ count, sh, shDegree }: GaussianCloud, bits: number, out: Uint8Array, at: number): number {
  const numbers = shCoefficientCount(shDegree);
  const step = 2 ** (8 - bits);
  for (let i = 0; i < count; i++) {
    for (let k = 1; k < numbers; k++) {
      for (let channel = 0; channel < 3; channel++) {
        const value = 128 + 128 * sh[3 * (numbers * i + k) + channel];
        out[at++] = byte(128 + step * Math.round((value - 128) / step));
      }
    }
  }
  return at;
}

async function gzip(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
