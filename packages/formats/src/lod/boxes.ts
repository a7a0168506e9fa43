import { LoadBudget, type LoadLimits } from '../budget.js';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { partAddress } from '../fetch-scene.js';
import { parseLodMeta, type LodRun } from './meta.js';

/** Splats `first` to `first + count` of one SOG file of a streamed scene. */
export interface SogRun extends SogAddress {
  /** Number of the file: see {@link LodScene.files}. */
  readonly file: number;
  readonly first: number;
  readonly count: number;
}

/** A SOG file of a streamed scene. */
export interface SogAddress {
  /** Absolute address of its `meta.json`, or of a bundle. */
  readonly url: string;
  /** What error messages call it. */
  readonly name: string;
}

/** A part of a streamed scene, and how it looks at each level of detail that it has. */
export interface LodBox {
  /** Corners, world units. */
  readonly min: readonly number[];
  readonly max: readonly number[];
  /** One or more, the coarsest first; each with a splat or more. */
  readonly runs: readonly SogRun[];
}

/** A streamed SOG scene, of which no splat has been read. */
export interface LodScene {
  readonly boxes: readonly LodBox[];
  /** Paths of all files, relative to the index. */
  readonly files: readonly string[];
  /** Splats that are always shown, if there are any. */
  readonly environment: SogAddress | undefined;
}

/** Splats of all levels together that an index may name. */
const MOST_SPLATS = 2 ** 31;
/** Charged for each file: its addresses, and the parsing of them. */
const FILE_BYTES = 512;
/** What is allocated for each before any is there: bounds and state of each 256. */
const KEPT_BYTES = 32 / 256;

/**
 * Reads the index of a streamed SOG scene, `lod-meta.json`, for those who fetch it box by box.
 * @param name what error messages call it
 * @param url absolute address of the index, which all others are relative to
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
  if (total > MOST_SPLATS) {
    throw damaged(`${name}, tree`, `at most ${grouped(MOST_SPLATS)} splats`, grouped(total), 'decode/header');
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
 * @param path relative to the index
 * @param name what error messages call the index
 * @param url absolute address of the index
 */
export const sogAddress = (path: string, name: string, url: string): SogAddress => ({
  url: partAddress(url, path).href,
  name: `${name}, ${path}`,
});
