import { GaussianSplatError, keepUsable, loadModule, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { LoadBudget } from './budget.js';
import { plainBytes, type FileBytes } from './bytes.js';
import { findFormat } from './detect.js';
import type * as rows from './ply/row-range.js';
import type * as gltf from './readers/gltf.js';
import type { SplatRange } from './scene-format.js';

/** Properties of a scene whose splats can be read in ranges, known before they are read. */
export interface SplatRanges {
  /** Number of splats, including unusable ones. */
  readonly count: number;
  readonly shDegree: ShDegree;
  /**
   * Location of the splats if each has the same size: offset of the first splat in the file, and size of a splat, in
   * bytes. Undefined for glTF.
   */
  readonly rows?: {
    readonly start: number;
    readonly byteLength: number;
    /**
     * Byte offsets in a row: of x, y, z, three scales, four rotations, opacity, three constant colors, and [channel][15]
     * harmonics, 0 for those above the degree. Undefined unless all are float32 of the host and keep their usual meaning.
     */
    readonly columns?: readonly number[] | undefined;
  };
}

/**
 * Returns the properties of a scene if ranges of its splats can be read independently, so that several threads can
 * share the work. Such scenes are binary PLY with rows of one size and float32 coordinates, and uncompressed glTF.
 *
 * @param file The whole file; for a PLY the first `HEADER_BYTES` are enough, and the presence of the rest is not
 * checked.
 * @param name File name or URL.
 * @returns Undefined if the scene must be read as a whole.
 * @throws GaussianSplatError as `readScene` does for invalid headers.
 */
export async function splatRanges(file: FileBytes, name: string): Promise<SplatRanges | undefined> {
  const bytes = plainBytes(file, name);
  const source = { bytes, name, budget: new LoadBudget(bytes.length) };
  switch (findFormat(bytes, name, '')?.name) {
    case 'ply':
      return (await loadRows()).plyRanges(source);
    case 'gltf':
      return (await loadGltf()).gltfSplats(source);
  }
}

/**
 * Reads a range of the splats of a scene that {@link splatRanges} describes, as `readScene` does.
 *
 * @param file The whole file.
 * @returns The splats of the range in the order of the file, without unusable splats; possibly none.
 * @throws GaussianSplatError as `readScene` does.
 */
export async function readSplats(file: FileBytes, range: SplatRange, name: string): Promise<GaussianCloud> {
  const bytes = plainBytes(file, name);
  const source = { bytes, name, range, budget: new LoadBudget(bytes.length) };
  const format = findFormat(bytes, name, '')?.name;
  if (format === 'ply') return keepUsable(await (await loadRows()).readPlyRange(source));
  if (format === 'gltf') return keepUsable(await (await loadGltf()).readGltf(source));
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: 'a PLY or glTF, whose splats can be read a few at a time',
    found: format ?? 'another file',
    remedy: 'ask splatRanges first, and call readScene where it answers undefined',
  });
}

const loadRows = (): Promise<typeof rows> =>
  loadModule('the code that reads rows of PLY', () => import('./ply/row-range.js'));

const loadGltf = (): Promise<typeof gltf> => loadModule('the code that reads glTF', () => import('./readers/gltf.js'));
