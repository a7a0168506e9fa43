/** A streamed SOG scene whose folder lies in memory, and the real one of the shared data. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { readCoarsestLevel, readLodScene, SogFiles } from '@gaussian-splat/formats';
import { StreamedGaussians, type PageSource, type PoolOptions } from '@gaussian-splat/renderer';
import {
  layoutLevels,
  levelSource,
  packLevelPage,
  type LevelPage,
  type LevelScene,
} from '@gaussian-splat/renderer/tools';
import { writeSog } from '../formats/support/sog-writer.js';

/** Address of the folders: no server exists, since the fetch function has the files. */
const ADDRESS = 'https://lod.test/scene/';

export interface LodFolder {
  readonly index: Uint8Array;
  /** Files by their paths, relative to the index. */
  readonly files: ReadonlyMap<string, Uint8Array>;
}

export interface LodFolderOptions {
  /** Each level has a quarter of the splats of the one before. */
  readonly levels: number;
  /** Slices of the scene along x. */
  readonly boxes: number;
  readonly environment?: GaussianCloud;
  /** The dialect of before version 1. */
  readonly isOld?: boolean;
}

/** Some splats of a cloud, enlarged by a factor. */
export function pick(cloud: GaussianCloud, indices: readonly number[], size = 1): GaussianCloud {
  const part = (values: Float32Array, stride: number, factor = 1): Float32Array => {
    const taken = new Float32Array(stride * indices.length);
    indices.forEach((i, k) =>
      taken.set(
        values.subarray(stride * i, stride * (i + 1)).map((x) => factor * x),
        stride * k,
      ),
    );
    return taken;
  };
  return {
    ...cloud,
    count: indices.length,
    positions: part(cloud.positions, 3),
    scales: part(cloud.scales, 3, size),
    rotations: part(cloud.rotations, 4),
    opacities: part(cloud.opacities, 1),
    sh: part(cloud.sh, cloud.sh.length / cloud.count),
  };
}

/** A folder with one file for each level, `0_0` the finest. */
export function lodFolder(cloud: GaussianCloud, { levels, boxes, environment, isOld }: LodFolderOptions): LodFolder {
  const { count, positions } = cloud;
  const order = Array.from({ length: count }, (_, i) => i).sort((a, b) => positions[3 * a] - positions[3 * b]);
  const slices = Array.from({ length: boxes }, (_, b) =>
    order.slice(Math.floor((b * count) / boxes), Math.floor(((b + 1) * count) / boxes)),
  );
  const files = new Map<string, Uint8Array>();
  const put = (folder: string, part: GaussianCloud): void => {
    for (const [path, bytes] of Object.entries(writeSog(part))) files.set(`${folder}/${path}`, bytes);
  };
  const lods: Record<string, object>[] = slices.map(() => ({}));
  for (let level = 0; level < levels; level++) {
    const chosen = slices.map((slice) => slice.filter((_, k) => k % 4 ** level === 0));
    let offset = 0;
    chosen.forEach((indices, b) => {
      lods[b][level] = { file: level, offset, count: indices.length };
      offset += indices.length;
    });
    put(`${level}_0`, pick(cloud, chosen.flat(), 2 ** level));
  }
  if (environment) put('env', environment);
  const bound = (slice: readonly number[]): object => {
    const axes = [0, 1, 2].map((axis) => slice.map((i) => positions[3 * i + axis]));
    return { min: axes.map((values) => Math.min(...values)), max: axes.map((values) => Math.max(...values)) };
  };
  const meta = {
    ...(isOld ? {} : { version: 1, count, counts: [] }),
    ...{ lodLevels: levels, filenames: Array.from({ length: levels }, (_, level) => `${level}_0/meta.json`) },
    ...(environment ? { environment: 'env/meta.json' } : isOld ? { environment: null } : {}),
    tree: { bound: bound(order), children: slices.map((slice, b) => ({ bound: bound(slice), lods: lods[b] })) },
  };
  return { index: new TextEncoder().encode(JSON.stringify(meta)), files };
}

export type FetchPart = (path: string, signal: AbortSignal) => Promise<Uint8Array>;

/** A scene that is streamed in this thread, without a worker. */
export interface OpenedLod {
  readonly levels: LevelScene;
  readonly source: PageSource;
  readonly scene: StreamedGaussians;
}

/** Opens a folder. @param fetch brings a file by its path, relative to the index */
export async function openLod(
  device: GPUDevice,
  index: Uint8Array,
  fetch: FetchPart,
  options: PoolOptions | ((source: PageSource) => PoolOptions) = {},
  files = new SogFiles(),
): Promise<OpenedLod> {
  const lod = readLodScene(index, 'lod-meta.json', `${ADDRESS}lod-meta.json`);
  const fetchBytes = (url: string, signal: AbortSignal): Promise<Uint8Array> =>
    fetch(decodeURIComponent(url.slice(ADDRESS.length)), signal);
  const coarsest = await readCoarsestLevel(lod, files, fetchBytes, 'lod-meta.json');
  const boxes = lod.boxes.map((box) => ({ ...box, counts: box.runs.map(({ count }) => count) }));
  const levels = layoutLevels(coarsest, boxes);
  const fetchLevel = async (page: LevelPage, signal: AbortSignal): Promise<Uint32Array<ArrayBuffer>> =>
    packLevelPage(await files.read(lod.boxes[page.box].runs[page.level], fetchBytes, signal), page, levels.scene);
  const source = levelSource(levels, fetchLevel);
  const pool = typeof options === 'function' ? options(source) : options;
  return { levels, source, scene: await StreamedGaussians.openSource(device, source, pool) };
}
