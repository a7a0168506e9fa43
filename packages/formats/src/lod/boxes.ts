import { LoadBudget, type LoadLimits } from '../budget.js';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { partAddress } from '../fetch-scene.js';
import { parseLodMeta, type LodRun } from './meta.js';

/** Splats `first` to `first + count` of one SOG file of a streamed scene. */
export interface SogRun extends SogAddress {
  /** Index of the file: see {@link LodScene.files}. */
  readonly file: number;
  readonly first: number;
  readonly count: number;
}

/** A SOG file of a streamed scene. */
export interface SogAddress {
  /** Absolute address of its `meta.json`, or of a bundle. */
  readonly url: string;
  /** Name in error messages. */
  readonly name: string;
}

/** A region of a streamed scene with its levels of detail. */
export interface LodBox {
  /** Corners, world units. */
  readonly min: readonly number[];
  readonly max: readonly number[];
  /** At least one, coarsest first; each has at least one splat. */
  readonly runs: readonly SogRun[];
}

/** A streamed SOG scene, before any splat is read. */
export interface LodScene {
  readonly boxes: readonly LodBox[];
  /** Paths of all files, relative to the index. */
  readonly files: readonly string[];
  /** Splats that are always shown, or undefined. */
  readonly environment: SogAddress | undefined;
}

/** Maximum number of splats over all levels of an index. */
const MAX_SPLATS = 2 ** 31;
/** Charge for each file: its addresses, and the parsing of them. */
const FILE_BYTES = 512;
/** Memory of each splat before any is loaded: bounds and state of each 256. */
const KEPT_BYTES = 32 / 256;

/**
 * Reads the index of a streamed SOG scene, `lod-meta.json`, for fetching it box by box.
 * @param name Name in error messages.
 * @param url Absolute address of the index, the base of all others.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported` for another version, `out-of-memory/budget`.
 */
export function readLodScene(bytes: Uint8Array, name: string, url: string, limits?: LoadLimits): LodScene {
  const budget = new LoadBudget(bytes.length, limits);
  const { files, leaves, environment } = parseLodMeta({ bytes, name, budget });
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
    environment: environment === undefined ? undefined : sogAddress(environment, name, url),
  };
}

const placeOf = ({ file, offset, count }: LodRun): Pick<SogRun, 'file' | 'first' | 'count'> => ({
  file,
  first: offset,
  count,
});

/**
 * A file of a streamed scene.
 * @param path Relative to the index.
 * @param name Name of the index in error messages.
 * @param url Absolute address of the index.
 */
export const sogAddress = (path: string, name: string, url: string): SogAddress => ({
  url: partAddress(url, path).href,
  name: `${name}, ${path}`,
});
