import {
  GaussianSplatError,
  type Bounds,
  type Credits,
  type ErrorCode,
  type FilterRule,
  type ShDegree,
  type TrainedOrder,
  type Vector3,
} from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { CLASSES, CLASS_STEP, MIN_OPACITY_STEP, type PageCoding } from './page-coding.js';
import { QUANTIZED_CHUNK_WORDS } from './quantized-geometry.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from '../pack/words.js';

/** Maximum number of chunks with the same parent. They form a page, which fills one slot of the pool. */
export const { SLOT_CHUNKS } = constants;
/** Maximum number of chunks in a file: four with one parent, and four children of each of these. */
const FILE_CHUNKS = 20;
/** Maximum length of an address in characters. The main thread parses it for each request of a page. */
const MAX_PATH = 2048;
/**
 * Maximum number of pages over all instances, for 4.3 billion splats. Each page takes about 90 bytes of CPU memory
 * before any page is loaded. Shaders use indices of 24 bits.
 */
export const MAX_PAGES = 1 << 22;

/**
 * A file of a tree. It contains a page of chunks with one parent, followed by the child pages of each of these chunks.
 * All pages except the last are full.
 */
export interface TreePage {
  /** Address of the file, relative to the manifest. */
  readonly file: string;
  /** Number of chunks in the file. */
  readonly chunks: number;
  /** Number of the first chunks, whose parent is in another file or missing. */
  readonly upper: number;
  /**
   * Index of the file in the tree that contains the parent, and index of the parent chunk in that file. Missing for the
   * first file of a tree.
   */
  readonly parent?: readonly [page: number, chunk: number];
}

/** A tree of files; parents precede their children. */
export interface Tree {
  readonly pages: readonly TreePage[];
}

/** An instance of a tree at its own position in the scene. It refines a chunk of the first instance. */
export interface TreeInstance {
  /** Index of the tree in {@link DetailManifest.trees}. */
  readonly tree: number;
  /** Translation in world units, added to every position of the tree. */
  readonly translate: Vector3;
  /**
   * Index of the file of the first instance, and of the chunk in it, that this tree refines. Missing for the first
   * instance.
   */
  readonly parent?: readonly [page: number, chunk: number];
}

/** Manifest (`detail.json`) of a streamed scene. docs/lod-format.md describes the files. */
export interface DetailManifest extends FilterRule, Credits {
  readonly format: 'gaussian-splat-detail';
  /** 2 with {@link geometry}, 4 with {@link coding}, otherwise 1. Version 3 was never released. */
  readonly version: 1 | 2 | 4;
  /** Number of splats in the finest level. */
  readonly splats: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /**
   * Layout of centers, shapes and opacities: see `packQuantizedChunk`. Default: that of `PackedGaussian`, which takes
   * twice the bytes.
   */
  readonly geometry?: 'quantized';
  /** Coding of the files, which `decodePage` converts to words. Default: files contain the words. */
  readonly coding?: PageCoding;
  /** Sort order of splats in training; undefined if splats were sorted by the depth of their centers. */
  readonly order?: TrainedOrder | undefined;
  readonly origin: Vector3;
  readonly bounds: Bounds;
  readonly trees: readonly Tree[];
  readonly instances: readonly TreeInstance[];
}

/** Properties that determine the size of a page. */
export type PageFormat = Pick<DetailManifest, 'shDegree' | 'shPrecision' | 'geometry'>;

/** Returns the number of words of each section of a file, or of a page, in the order of the sections. */
export function pageLayout(
  { shDegree, shPrecision, geometry }: PageFormat,
  chunks: number,
): { chunks: number; details: number; geometry: number; sh: number; total: number } {
  const splats = constants.CULL_GROUP * chunks;
  const parts = {
    chunks: CHUNK_NUMBERS * chunks,
    details: DETAIL_NUMBERS * chunks,
    geometry: geometry === 'quantized' ? QUANTIZED_CHUNK_WORDS * chunks : GEOMETRY_WORDS * splats,
    sh: shWords(shDegree, shPrecision) * splats,
  };
  return { ...parts, total: parts.chunks + parts.details + parts.geometry + parts.sh };
}

function shown(value: unknown): string {
  try {
    return String(JSON.stringify(value)).slice(0, 80);
  } catch {
    // JSON.stringify throws for values that are nested deeper than the call stack allows.
    return 'a value that is too deep to be shown';
  }
}

/**
 * Validates a parsed manifest, and returns it.
 * @param where Name of the manifest, for error messages.
 * @param maxPages Maximum number of pages that the caller can hold in memory.
 * @throws GaussianSplatError `out-of-memory/budget` for more pages; `decode/unsupported` for another format or version;
 * `decode/header` for other faults.
 */
export function checkManifest(value: unknown, where: string, maxPages = MAX_PAGES): DetailManifest {
  const manifest = (typeof value === 'object' && value !== null ? value : {}) as Partial<DetailManifest>;
  const fail = (path: string, expected: string, found: unknown, code: ErrorCode = 'decode/header'): never => {
    throw new GaussianSplatError(code, {
      where: `${where}, ${path}`,
      expected,
      found: shown(found),
      remedy: 'write the folder again with gaussian-splat detail',
    });
  };
  const { format, version, splats, shDegree, shPrecision, geometry, antialiased, origin, bounds } = manifest;
  const { trees, instances } = manifest;
  if (format !== 'gaussian-splat-detail') fail('format', 'gaussian-splat-detail', format, 'decode/unsupported');
  if (![1, 2, 4].includes(version as number)) fail('version', '1, 2 or 4', version, 'decode/unsupported');
  if (!isCount(splats)) fail('splats', 'a number of splats', splats);
  if (![0, 1, 2, 3].includes(shDegree as number)) fail('shDegree', '0, 1, 2 or 3', shDegree);
  if (shPrecision !== 'int8' && shPrecision !== 'float16') fail('shPrecision', 'int8 or float16', shPrecision);
  const kind = version === 1 ? undefined : 'quantized';
  if (geometry !== kind) fail('geometry', kind ?? 'nothing in version 1', geometry, 'decode/unsupported');
  checkCoding(manifest, fail);
  if (typeof antialiased !== 'boolean') fail('antialiased', 'true or false', antialiased);
  const { filterVariance } = manifest;
  if (filterVariance !== undefined && !(filterVariance >= 0 && filterVariance <= 1)) {
    fail('filterVariance', 'a variance of 0 to 1 px², or nothing', filterVariance);
  }
  const { order } = manifest;
  if (order !== undefined && order !== 'pixel' && order !== 'distance')
    fail('order', 'pixel, distance, or nothing', order);
  for (const name of ['attribution', 'license'] as const)
    if (!['undefined', 'string'].includes(typeof manifest[name])) fail(name, 'a text, or nothing', manifest[name]);
  if (!isVector(origin)) fail('origin', '3 numbers', origin);
  const hasBounds = isVector(bounds?.min) && isVector(bounds.max) && isVector(bounds.center);
  if (!hasBounds || !Number.isFinite(bounds?.radius)) fail('bounds', 'min, max, center and radius', bounds);
  const { subject, inside } = bounds!;
  const isBall = subject === undefined || (isVector(subject?.center) && Number.isFinite(subject.radius));
  if (!isBall) fail('bounds.subject', 'center and radius, or nothing', subject);
  const isView = inside === undefined || [inside?.center, inside?.toward, [inside?.radius, 0, 0]].every(isVector);
  if (!isView) fail('bounds.inside', 'center, radius and toward, or nothing', inside);
  if (!Array.isArray(trees) || trees.length === 0) fail('trees', 'one tree or more', trees);
  trees!.forEach((tree, t) => checkTree(tree, (path, ...rest) => fail(`trees[${t}].${path}`, ...rest)));
  if (!Array.isArray(instances) || instances.length === 0) fail('instances', 'one instance or more', instances);
  instances!.forEach((instance, i) => {
    const isFine =
      isCount(instance?.tree) &&
      instance.tree < trees!.length &&
      isVector(instance.translate) &&
      (i === 0) === (instance.parent === undefined) &&
      (i === 0 || isPlace(instance.parent, trees![instances![0].tree].pages));
    if (!isFine) fail(`instances[${i}]`, 'a tree, its translation, and its parent chunk', instance);
  });
  checkPages(manifest as DetailManifest, fail, Math.min(MAX_PAGES, maxPages));
  return manifest as DetailManifest;
}

/** Minimum and maximum of each value of a coding. The upper limit of color steps has no practical meaning. */
const CODING_RANGES: Readonly<Record<keyof PageCoding, readonly [min: number, max: number]>> = {
  size: [1 / 48, 1],
  directions: [3, 255],
  opacity: [MIN_OPACITY_STEP, 512],
  color: [0, 1e6],
  chroma: [0, 1e6],
  scale: [0, 255 - CLASS_STEP * (CLASSES - 1)],
};

function checkCoding({ version, coding, shPrecision }: Partial<DetailManifest>, fail: Fail): void {
  if (version !== 4) return void (coding === undefined || fail('coding', 'nothing before version 4', coding));
  if (shPrecision !== 'int8') fail('shPrecision', 'int8 where files are coded', shPrecision);
  for (const [key, [min, max]] of Object.entries(CODING_RANGES)) {
    const value = coding?.[key as keyof PageCoding];
    const isFine = typeof value === 'number' && value >= min && value <= max;
    const isWhole = ['directions', 'opacity', 'scale'].includes(key);
    if (!isFine || (isWhole && !Number.isInteger(value))) fail(`coding.${key}`, `${min} to ${max}`, value);
  }
}

/** Checks that files and instances, which are valid on their own, are consistent with each other. */
function checkPages({ trees, instances }: DetailManifest, fail: Fail, maxPages: number): void {
  const lengths = new Map<string, number>();
  const taken = trees.map((tree, t) => {
    const places = new Places(tree);
    tree.pages.forEach(({ file, chunks, parent }, p) => {
      const path = `trees[${t}].pages[${p}]`;
      if ((lengths.get(file) ?? chunks) !== chunks) fail(path, `as many chunks of ${file} as elsewhere`, chunks);
      if (parent && !places.take(parent)) fail(path, 'a chunk without another child', parent);
      lengths.set(file, chunks);
    });
    return places;
  });
  const first = taken[instances[0].tree];
  instances.forEach(({ parent }, i) => {
    if (parent && !first.take(parent)) fail(`instances[${i}]`, 'a chunk without another child', parent);
  });
  const counts = trees.map(({ pages }) => pages.reduce((sum, file) => sum + pagesIn(file), 0));
  const count = instances.reduce((sum, { tree }) => sum + counts[tree], 0);
  if (count > MAX_PAGES) fail('instances', `at most ${MAX_PAGES} pages`, count);
  if (count > maxPages)
    fail('instances', `at most ${maxPages} pages in a file of this size`, count, 'out-of-memory/budget');
}

/** Returns the number of pages in a file. */
const pagesIn = ({ chunks, upper }: TreePage): number => 1 + Math.ceil((chunks - upper) / SLOT_CHUNKS);

/** Marks the chunks of a tree that have children. */
class Places {
  readonly #pages: readonly TreePage[];
  readonly #taken = new Set<number>();

  constructor({ pages }: Tree) {
    this.#pages = pages;
  }

  /** Marks a chunk as a parent. @returns False if the chunk already had children. */
  take([page, chunk]: readonly [number, number]): boolean {
    const place = FILE_CHUNKS * page + chunk;
    const isTaken = this.#taken.has(place) || chunk < pagesIn(this.#pages[page]) - 1;
    this.#taken.add(place);
    return !isTaken;
  }
}

type Fail = (path: string, expected: string, found: unknown, code?: ErrorCode) => never;

function checkTree(tree: Tree, fail: Fail): void {
  if (!Array.isArray(tree?.pages) || tree.pages.length === 0) fail('pages', 'one file or more', tree);
  tree.pages.forEach((page, p) => {
    const isFine =
      typeof page?.file === 'string' &&
      page.file.length <= MAX_PATH &&
      isCount(page.chunks) &&
      page.chunks >= 1 &&
      isCount(page.upper) &&
      page.upper >= 1 &&
      page.upper <= Math.min(SLOT_CHUNKS, page.chunks) &&
      page.chunks <= page.upper * (1 + SLOT_CHUNKS) &&
      (p === 0) === (page.parent === undefined) &&
      (p === 0 || isPlace(page.parent, tree.pages, p));
    if (!isFine) fail(`pages[${p}]`, `a file of 1 to ${FILE_CHUNKS} chunks below an earlier one`, page);
  });
}

const isCount = (value: unknown): value is number => Number.isSafeInteger(value) && (value as number) >= 0;

const isVector = (value: unknown): value is Vector3 =>
  Array.isArray(value) && value.length === 3 && value.every((number) => Number.isFinite(number));

/** Whether the value is the index of a file below `end`, and the index of a chunk in that file. */
function isPlace(value: unknown, pages: readonly TreePage[], end = pages.length): boolean {
  if (!Array.isArray(value) || value.length !== 2) return false;
  const [page, chunk] = value as [unknown, unknown];
  return isCount(page) && page < end && isCount(chunk) && chunk < pages[page].chunks;
}
