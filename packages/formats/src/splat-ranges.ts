import { GaussianSplatError, keepUsable, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { LoadBudget } from './budget.js';
import { plainBytes, type FileBytes } from './bytes.js';
import { findFormat } from './detect.js';
import type { SplatRange } from './scene-format.js';

/** What is known before they are read of splats any of which can be read without the others. */
export interface SplatRanges {
  /** Number of splats, those too that cannot be drawn. */
  readonly count: number;
  readonly shDegree: ShDegree;
  /** Where they lie if the splats of the file take as many bytes each: byte of the first, and bytes of one. */
  readonly rows?: { readonly start: number; readonly byteLength: number };
}

/**
 * Tells whether some of a scene's splats can be read without the others, so that several threads can share the reading: of binary PLY whose rows have one size and float32
 * coordinates, and of uncompressed glTF.
 *
 * @param file the whole file; of a PLY `HEADER_BYTES` of its beginning are enough, and it is not checked that the rest is there.
 * @returns undefined if it must be read whole
 * @throws GaussianSplatError as `readScene` does for what is wrong with a header
 */
export async function splatRanges(file: FileBytes, name: string): Promise<SplatRanges | undefined> {
  const bytes = plainBytes(file, name);
  const source = { bytes, name, budget: new LoadBudget(bytes.length) };
  switch (findFormat(bytes, name, '')?.name) {
    case 'ply':
      return (await import('./ply/row-range.js')).plyRanges(source);
    case 'gltf':
      return (await import('./readers/gltf.js')).gltfSplats(source);
  }
}

/**
 * Reads some of the splats of a scene that {@link splatRanges} describes: what `readScene` makes of them, without regard to the rest of the file.
 *
 * @param file the whole file
 * @returns the splats in the order of the file. Those that cannot be drawn are left out, which may be all.
 * @throws GaussianSplatError as `readScene` does
 */
export async function readSplats(file: FileBytes, range: SplatRange, name: string): Promise<GaussianCloud> {
  const bytes = plainBytes(file, name);
  const source = { bytes, name, range, budget: new LoadBudget(bytes.length) };
  const format = findFormat(bytes, name, '')?.name;
  if (format === 'ply') return keepUsable(await (await import('./ply/row-range.js')).readPlyRange(source));
  if (format === 'gltf') return keepUsable(await (await import('./readers/gltf.js')).readGltf(source));
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: 'a PLY or glTF, whose splats can be read a few at a time',
    found: format ?? 'another file',
    remedy: 'ask splatRanges first, and call readScene where it answers undefined',
  });
}
