import type { Credits } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { partAddress } from '../fetch-scene.js';
import { parseLodMeta, type LodRun } from './meta.js';

/** Range of splats in a SOG file of a streamed scene: `first` to `first + count`, excluding the latter. */
export interface SogRun extends SogAddress {
  /** Index of the file in {@link LodScene.files}. */
  readonly file: number;
  readonly first: number;
  readonly count: number;
}

/** Location of a SOG file of a streamed scene. */
export interface SogAddress {
  /** Absolute URL of the `meta.json` of a SOG folder, or of a bundle. */
  readonly url: string;
  /** Name of the file in error messages. */
  readonly name: string;
}

/** A region of a streamed scene with its levels of detail. */
export interface LodBox {
  /** Corner (x, y, z) with the smallest coordinates, in units of the scene. */
  readonly min: readonly number[];
  /** Corner (x, y, z) with the largest coordinates. */
  readonly max: readonly number[];
  /** One range of splats for each level of detail, coarsest first. There is at least one, and none is empty. */
  readonly runs: readonly SogRun[];
}

/** Index of a streamed SOG scene. */
export interface LodScene {
  readonly boxes: readonly LodBox[];
  /** Paths of all SOG files, relative to the index. */
  readonly files: readonly string[];
  /** File whose splats are shown at every level, or undefined. */
  readonly environment: SogAddress | undefined;
  /** Credits that the index declares. */
  readonly credits?: Credits | undefined;
}

/** Maximum number of splats over all levels of an index. */
const MAX_SPLATS = 2 ** 31;
/** Bytes that are charged for each file, for its URLs and their parsing, in addition to the length of the base URL. */
const FILE_BYTES = 512;
/** Bytes of memory for each splat before it is loaded: bounds and state of each 256 splats. */
const KEPT_BYTES = 32 / 256;

/**
 * Parses the index of a streamed SOG scene, `lod-meta.json`, whose boxes can then be loaded separately.
 * @param name Name of the index in error messages.
 * @param url Absolute URL of the index, the base of the paths of all files.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported` for another version, `out-of-memory/budget`.
 */
export function readLodScene(bytes: Uint8Array, name: string, url: string, limits?: LoadLimits): LodScene {
  const budget = new LoadBudget(bytes.length, limits);
  const { files, leaves, environment, credits } = parseLodMeta({ bytes, name, budget });
  budget.take(files.length * (FILE_BYTES + url.length), name);
  const addresses = files.map((path) => sogAddress(path, name, url));
  const boxes = leaves.map(({ min, max, levels }) => ({
    ...{ min, max },
    runs: levels.flatMap((run) => (run && run.count > 0 ? { ...addresses[run.file], ...placeOf(run) } : [])).reverse(),
  }));
  const total = boxes.reduce((sum, { runs }) => runs.reduce((own, { count }) => own + count, sum), 0);
  if (total > MAX_SPLATS) {
    throw damaged(`${name}, tree`, `at most ${grouped(MAX_SPLATS)} splats`, grouped(total), 'decode/header');
  }
  budget.take(total * KEPT_BYTES, name);
  return {
    boxes: boxes.filter(({ runs }) => runs.length > 0),
    files,
    ...(credits && { credits }),
    environment: environment === undefined ? undefined : sogAddress(environment, name, url),
  };
}

const placeOf = ({ file, offset, count }: LodRun): Pick<SogRun, 'file' | 'first' | 'count'> => ({
  file,
  first: offset,
  count,
});

/**
 * Returns the location of a file of a streamed scene.
 * @param path Path of the file, relative to the index.
 * @param name Name of the index in error messages.
 * @param url Absolute URL of the index.
 */
export const sogAddress = (path: string, name: string, url: string): SogAddress => ({
  url: partAddress(url, path).href,
  name: `${name}, ${path}`,
});
