import type { ShDegree } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { shNumbers } from '../levels/splat-level.js';

/**
 * Quantization of the splats of coded pages, the same in all files of a folder. Each file adds the coordinate step of
 * each chunk, and the smallest size. docs/lod-format.md describes the files.
 */
export interface PageCoding {
  /** Step between sizes in octaves, 1/48 to 1. */
  readonly size: number;
  /** Steps along each axis of the direction maps, 3 to 255, odd so that one of them is the center. */
  readonly directions: number;
  /** Step between opacities, in 1/1500, 16 to 512. */
  readonly opacity: number;
  /** Steps of the constant coefficient: of its luma, and of its two color differences. */
  readonly color: number;
  readonly chroma: number;
  /**
   * Step of the higher coefficients: 2^(scale / 8 - 16) / 127, twice as much for color differences, in splats of the
   * first class; each further class doubles it. 0 to 207.
   */
  readonly scale: number;
}

/** Parameters for decoding one file. */
export interface CodedFile {
  readonly chunks: number;
  readonly upper: number;
  readonly shDegree: ShDegree;
  readonly coding: PageCoding;
}

/** Steps of the GPU's words in one of {@link PageCoding.size}: the largest of 1023 must be a size that shaders accept. */
export const SIZE_CODES = 4;
/** Minimum of these steps, so that an opacity above 1 fits one byte. */
export const MIN_OPACITY_STEP = 16;
/** Color differences above the constant one are even, so half of them is an integer. */
export const CHROMA_CODES = 2;

/**
 * Numbers in each chunk: origin, step, reach, sphere and error; and in each file: the sphere and error of the parent of
 * its upper chunks, and the log2 of the smallest size.
 */
export const CHUNK_FLOATS = 10;
export const FILE_FLOATS = 6;

/**
 * Byte planes with one byte for each splat of a file; those of harmonics have one for each splat with a class above 0.
 */
export const PLANES = { place: 0, size: 6, direction: 9, opacity: 12, color: 13, class: 19, harmonics: 20 } as const;

export const planesOf = (degree: ShDegree): number =>
  degree > 0 ? PLANES.harmonics + shNumbers(degree) - 3 : PLANES.class;

/** Offset of the 16 bits of a constant coefficient, so that the upper byte is nearly always 0. */
export const MIDDLE = 128;

/** Classes of splats by the precision of their harmonics; class 0 has none. */
export const CLASSES = 7;
/** Difference between the scales of two classes. */
export const CLASS_STEP = 8;

/**
 * Bytes of a decompressed file in front of its planes: the number of splats of each chunk, the numbers, and the coding
 * of each plane.
 */
export const headBytes = ({ chunks, shDegree }: Pick<CodedFile, 'chunks' | 'shDegree'>): number =>
  chunks + 4 * (CHUNK_FLOATS * chunks + FILE_FLOATS) + planesOf(shDegree);

/** Maximum number of bytes in a decompressed file. */
export const maxBytes = (file: Pick<CodedFile, 'chunks' | 'shDegree'>): number =>
  headBytes(file) + constants.CULL_GROUP * file.chunks * planesOf(file.shDegree);

/** Coding of a plane: its bytes, or the differences from the previous byte. */
export const PLAIN = 0;
export const DIFFERENCES = 1;

/** Interleaves bits 0 to 7 of three numbers. */
export function interleaved(x: number, y: number, z: number): number {
  return (spread(x & 255) << 2) | (spread(y & 255) << 1) | spread(z & 255);
}

/** Extracts the first of three {@link interleaved} numbers; shift for the others. */
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
