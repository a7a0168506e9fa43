import type { ShDegree } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { shNumbers } from '../levels/splat-level.js';

/**
 * Quantization of the splats in coded pages. All files of a folder use the same steps; each file adds the coordinate
 * step of each chunk, and the smallest size. docs/lod-format.md describes the files.
 */
export interface PageCoding {
  /** Step between sizes in octaves, 1/48 to 1. */
  readonly size: number;
  /** Number of steps along each axis of the direction maps, 3 to 255. Odd, so that one step is the center. */
  readonly directions: number;
  /** Step between opacities in units of 1/1500, 16 to 512. */
  readonly opacity: number;
  /** Step of the luma of the constant coefficient. */
  readonly color: number;
  /** Step of the two color differences of the constant coefficient. */
  readonly chroma: number;
  /**
   * Scale of the higher coefficients, 0 to 207. Their step is 2^(scale / 8 - 16) / 127 for splats of the first class,
   * and twice as much for color differences. Each further class doubles the steps.
   */
  readonly scale: number;
}

/**
 * Parameters that decode one file: its chunks, its `upper` chunks (see `TreePage`), and the properties of the scene.
 */
export interface CodedFile {
  readonly chunks: number;
  readonly upper: number;
  readonly shDegree: ShDegree;
  readonly coding: PageCoding;
}

/**
 * Number of size steps of the GPU's words in one step of {@link PageCoding.size}. The largest of the 1,023 steps must
 * be a size that shaders accept.
 */
export const SIZE_CODES = 4;
/** Minimum of {@link PageCoding.opacity}, so that an opacity above 1 fits one byte. */
export const MIN_OPACITY_STEP = 16;
/** Factor of the codes of higher color differences: decoding halves them, and half of an even code is an integer. */
export const CHROMA_CODES = 2;

/** Number of float32 for each chunk: origin, step, reach, sphere and error. */
export const CHUNK_FLOATS = 10;
/**
 * Number of float32 for each file: sphere and error of the parent of its upper chunks, and log2 of the smallest size.
 */
export const FILE_FLOATS = 6;

/**
 * Index of the first byte plane of each property. A plane has one byte for each splat of a file; planes of harmonics
 * have one for each splat with a class above 0.
 */
export const PLANES = { place: 0, size: 6, direction: 9, opacity: 12, color: 13, class: 19, harmonics: 20 } as const;

/** Returns the number of byte planes for a degree of spherical harmonics. */
export const planesOf = (degree: ShDegree): number =>
  degree > 0 ? PLANES.harmonics + shNumbers(degree) - 3 : PLANES.class;

/** Offset of the 16 bits of a constant coefficient, which makes the upper byte 0 for nearly all splats. */
export const MIDDLE = 128;

/** Number of classes of splats by the precision of their harmonics, without class 0, which has no harmonics. */
export const CLASSES = 7;
/** Difference between the scales of two consecutive classes. */
export const CLASS_STEP = 8;

/**
 * Returns the number of bytes in front of the planes of a decompressed file. They contain the number of splats of each
 * chunk, the float32 numbers, and the coding of each plane, with one byte for each plane.
 */
export const headBytes = ({ chunks, shDegree }: Pick<CodedFile, 'chunks' | 'shDegree'>): number =>
  chunks + 4 * (CHUNK_FLOATS * chunks + FILE_FLOATS) + planesOf(shDegree);

/** Returns the maximum number of bytes in a decompressed file. */
export const maxBytes = (file: Pick<CodedFile, 'chunks' | 'shDegree'>): number =>
  headBytes(file) + constants.CULL_GROUP * file.chunks * planesOf(file.shDegree);

/** Coding of a plane that contains its bytes. */
export const PLAIN = 0;
/** Coding of a plane that contains the differences from the previous byte. */
export const DIFFERENCES = 1;

/** Interleaves bits 0 to 7 of three numbers. */
export function interleaved(x: number, y: number, z: number): number {
  return (spread(x & 255) << 2) | (spread(y & 255) << 1) | spread(z & 255);
}

/**
 * Extracts the first of three {@link interleaved} numbers. Shift the code right by 1 or 2 bits for the third or second.
 */
export function compactBits(code: number): number {
  let bits = (code >>> 2) & 0x249249;
  bits = (bits | (bits >>> 2)) & 0x0c30c3;
  bits = (bits | (bits >>> 4)) & 0x00f00f;
  return (bits | (bits >>> 8)) & 0xff;
}

function spread(byte: number): number {
  let bits = (byte | (byte << 8)) & 0x00f00f;
  bits = (bits | (bits << 4)) & 0x0c30c3;
  return (bits | (bits << 2)) & 0x249249;
}
