import type { ShDegree } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { shNumbers } from '../levels/splat-level.js';

/**
 * How the splats of coded pages are rounded, the same in all files of a folder. A file says the rest: how far apart coordinates are in each chunk, and where sizes begin.
 * docs/lod-format.md describes the files.
 */
export interface PageCoding {
  /** Octaves between two sizes, 1/48 to 1. */
  readonly size: number;
  /** Places along each axis of the maps that directions are in, 3 to 255, odd so that one of them is the middle. */
  readonly directions: number;
  /** Between two opacities, in 1/1500, 16 to 512. */
  readonly opacity: number;
  /** Between two values of the constant coefficient: its luma, and its two differences of colours. */
  readonly color: number;
  readonly chroma: number;
  /** Of the coefficients above it: 2^(scale / 8 - 16) / 127 apart, their differences of colours twice as much, in splats of the first class; in each other class twice as far as in the one before. 0 to 207. */
  readonly scale: number;
}

/** What one coded file is read by. */
export interface CodedFile {
  readonly chunks: number;
  readonly upper: number;
  readonly shDegree: ShDegree;
  readonly coding: PageCoding;
}

/** Steps of the GPU's words in one of {@link PageCoding.size}: the largest of 1023 must be a size that shaders take. */
export const SIZE_CODES = 4;
/** The least of these steps, so that an opacity above 1 is one byte. */
export const LEAST_OPACITY_STEP = 16;
/** Differences of colours above the constant one are even: half of them is a whole number. */
export const CHROMA_CODES = 2;

/** Numbers of a chunk: origin, step, reach, sphere and error; and of a file: the sphere and error above its upper chunks, and the log2 of the least size. */
export const CHUNK_FLOATS = 10;
export const FILE_FLOATS = 6;

/** Planes of bytes, one for each splat of a file; those of harmonics, one for each that is of a class. */
export const PLANES = { place: 0, size: 6, direction: 9, opacity: 12, color: 13, class: 19, harmonics: 20 } as const;

export const planesOf = (degree: ShDegree): number =>
  degree > 0 ? PLANES.harmonics + shNumbers(degree) - 3 : PLANES.class;

/** What is added to the 16 bits of a constant coefficient: the upper byte of nearly all is 0 then. */
export const MIDDLE = 128;

/** Classes of splats by how precise their harmonics are; 0 is of those that have none. */
export const CLASSES = 7;
/** Between the scales of two classes. */
export const CLASS_STEP = 8;

/** Bytes of a decompressed file before its planes: the number of splats of each chunk, numbers, and how each plane is coded. */
export const headBytes = ({ chunks, shDegree }: Pick<CodedFile, 'chunks' | 'shDegree'>): number =>
  chunks + 4 * (CHUNK_FLOATS * chunks + FILE_FLOATS) + planesOf(shDegree);

/** Bytes of a decompressed file at most. */
export const mostBytes = (file: Pick<CodedFile, 'chunks' | 'shDegree'>): number =>
  headBytes(file) + constants.CULL_GROUP * file.chunks * planesOf(file.shDegree);

/** How a plane is coded: by its bytes, or by what each adds to the one before. */
export const PLAIN = 0;
export const DIFFERENCES = 1;

/** Bits 0 to 7 of three numbers, one after the other. */
export function interleaved(x: number, y: number, z: number): number {
  return (spread(x & 255) << 2) | (spread(y & 255) << 1) | spread(z & 255);
}

/** The first of three numbers that are {@link interleaved}; the others by shifting. */
export function gathered(code: number): number {
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
