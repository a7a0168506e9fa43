/** Scenes of any size as blocks of splats: files of rows are read in ranges, SPZ by way of an inflated copy on the disk. */
import {
  createReadStream,
  createWriteStream,
  existsSync,
  openSync,
  readSync,
  closeSync,
  rmSync,
  statSync,
} from 'node:fs';
import { dirname, extname, resolve } from 'node:path';
import { pipeline } from 'node:stream/promises';
import { createGunzip, gzipSync } from 'node:zlib';
import { readPrefix, readScene, turned, upright, uprightRotation } from '@gaussian-splat/formats';
import { CommandError, UsageError } from '../command.mjs';
import { readerBeside, readJson, readWhole } from '../input-file.mjs';
import { rangesOf } from '../scene-in-parts.mjs';

/** Splats of a block. */
const BLOCK = 1 << 16;
/** Largest list of scenes in bytes; larger JSON is no list. */
const MAX_LIST = 1 << 26;

/**
 * Returns the files of a scene with their transforms: of a list, `{"scenes": [{"file", "transform"}, ...]}`, or the file
 * itself. A transform has 16 numbers in the order of columns, as in glTF and 3D Tiles.
 * @throws UsageError for a list with faults
 */
export function inputsOf(path) {
  if (extname(path).toLowerCase() !== '.json' || !existsSync(path) || statSync(path).size > MAX_LIST) return [{ path }];
  const { scenes } = readJson(path) ?? {};
  if (!Array.isArray(scenes)) return [{ path }];
  if (scenes.length === 0) throw new UsageError(`${path}: expected scenes, found an empty list`);
  return scenes.map((scene, k) => {
    const { file, transform } = scene ?? {};
    const where = `${path}, scenes[${k}]`;
    if (typeof file !== 'string')
      throw new UsageError(`${where}.file: expected the path of a file, found ${typeof file}`);
    const part = resolve(dirname(path), file);
    if (!existsSync(part)) throw new UsageError(`${where}.file: there is no file ${part}`);
    if (transform !== undefined && !isTransform(transform))
      throw new UsageError(`${where}.transform: expected 16 finite numbers, column by column, the last row 0, 0, 0, 1`);
    return { path: part, transform };
  });
}

const isTransform = (m) =>
  Array.isArray(m) && m.length === 16 && m.every(Number.isFinite) && !m[3] && !m[7] && !m[11] && m[15] === 1;

/** Names, sizes and times of the files of a scene: what must not change between the parts of a build. */
export function stateOf(inputs) {
  return inputs.map(({ path, transform }) => {
    const { size, mtimeMs } = statSync(path);
    return [path, size, mtimeMs, transform ?? null];
  });
}

/**
 * Reads the splats of a file in their order, upright and transformed.
 * @param options `temporary`: path of a file that may be written meanwhile. `maxBytes`: memory of a file that has to be
 * read whole.
 * @returns {AsyncGenerator<GaussianCloud>} Blocks of up to 65,536 usable splats, in shared memory: use one before the next.
 * @throws GaussianSplatError as `readScene` does
 */
export async function* blocksOf({ path, transform }, options) {
  for await (const block of await blocksAsStored(path, options))
    yield { ...placed(upright(block), transform), turn: uprightRotation(block) };
}

function placed(cloud, transform) {
  if (transform === undefined) return cloud;
  const [a, b, c, , d, e, f, , g, h, i, , x, y, z] = transform;
  const linear = [a, d, g, b, e, h, c, f, i];
  const moved = linear.every((value, k) => value === (k % 4 === 0 ? 1 : 0)) ? cloud : turned(cloud, linear);
  return { ...moved, origin: [moved.origin[0] + x, moved.origin[1] + y, moved.origin[2] + z] };
}

async function blocksAsStored(path, options) {
  const ranges = await rangesOf(path);
  if (ranges) return rowBlocks(path, ranges);
  const planes = await inflatedSpz(path, options.temporary);
  if (planes) return spzBlocks(path, planes, options.temporary);
  return wholeBlocks(path, options.maxBytes);
}

/** Reads each block of rows as a file of its own: the header, followed by the rows. */
async function* rowBlocks(path, { head, ranges }) {
  const { count, rows } = ranges;
  const room = new Uint8Array(head.length + rows.byteLength * Math.min(BLOCK, count));
  room.set(head);
  const file = openSync(path);
  try {
    for (let first = 0; first < count; first += BLOCK) {
      const byteLength = rows.byteLength * Math.min(BLOCK, count - first);
      readAt(file, room.subarray(head.length, head.length + byteLength), head.length + rows.byteLength * first);
      const cloud = await readPrefix(room.subarray(0, head.length + byteLength), { name: path });
      if (cloud) yield cloud;
    }
  } finally {
    closeSync(file);
  }
}

const SPZ_HEAD = 16;

/** Inflates an SPZ file of version 1 to 3 to the disk. @returns Its header and attributes; undefined for another file. */
async function inflatedSpz(path, temporary) {
  const beginning = new Uint8Array(2);
  const file = openSync(path);
  const isGzip = readSync(file, beginning, 0, 2, 0) === 2 && beginning[0] === 0x1f && beginning[1] === 0x8b;
  closeSync(file);
  if (!isGzip) return undefined;
  await pipeline(createReadStream(path), createGunzip(), createWriteStream(temporary)).catch((error) => {
    // Reading the whole file reports the fault of a damaged one.
    if (error.syscall) throw error;
  });
  const { size } = statSync(temporary);
  const head = new Uint8Array(Math.min(size, SPZ_HEAD));
  const opened = openSync(temporary);
  readAt(opened, head, 0);
  closeSync(opened);
  if (head.length < SPZ_HEAD || String.fromCharCode(...head.subarray(0, 4)) !== 'NGSP') return undefined;
  const view = new DataView(head.buffer);
  const [version, count, degree] = [view.getUint32(4, true), view.getUint32(8, true), head[12]];
  const widths = [version === 1 ? 6 : 9, 1, 3, 3, version >= 3 ? 4 : 3, 3 * ((degree + 1) ** 2 - 1)];
  const end = SPZ_HEAD + count * widths.reduce((a, b) => a + b, 0);
  return count > 0 && degree <= 3 && size >= end && size - end < 1 << 20
    ? { head, count, widths, end, size }
    : undefined;
}

/** Reads each block as a file of its own: the header, a slice of each attribute, and what follows the attributes. */
async function* spzBlocks(path, { head, count, widths, end, size }, temporary) {
  const file = openSync(temporary);
  try {
    for (let first = 0; first < count; first += BLOCK) {
      const splats = Math.min(BLOCK, count - first);
      const bytes = new Uint8Array(SPZ_HEAD + splats * widths.reduce((a, b) => a + b, 0) + size - end);
      bytes.set(head);
      new DataView(bytes.buffer).setUint32(8, splats, true);
      let [from, to] = [SPZ_HEAD, SPZ_HEAD];
      for (const width of widths) {
        readAt(file, bytes.subarray(to, to + width * splats), from + width * first);
        [from, to] = [from + width * count, to + width * splats];
      }
      readAt(file, bytes.subarray(to), end);
      const cloud = await readScene(gzipSync(bytes, { level: 0 }), { name: path }).catch((error) => {
        if (error.code !== 'decode/empty') throw error;
      });
      if (cloud) yield cloud;
    }
  } finally {
    closeSync(file);
    rmSync(temporary);
  }
}

async function* wholeBlocks(path, maxBytes) {
  const tooLarge = (found) =>
    new CommandError(
      `${path}: expected at most ${Math.floor(maxBytes / 1e6)} MB, because this format is read whole, found ${found}. ` +
        'Raise --memory, or convert it to PLY or SPZ.',
    );
  const { size } = statSync(path);
  if (size > maxBytes) throw tooLarge(`${Math.ceil(size / 1e6)} MB`);
  const options = { name: path, openFile: readerBeside(path), maxBytes };
  const cloud = await readScene(await readWhole(path), options).catch((error) => {
    throw error.code === 'out-of-memory/budget' ? tooLarge('more in its splats') : error;
  });
  const stride = cloud.sh.length / cloud.count;
  for (let first = 0; first < cloud.count; first += BLOCK) {
    const end = Math.min(cloud.count, first + BLOCK);
    const cut = (array, width) => array.subarray(width * first, width * end);
    const { positions, scales, rotations, opacities, sh } = cloud;
    yield {
      ...cloud,
      count: end - first,
      ...{ positions: cut(positions, 3), scales: cut(scales, 3), rotations: cut(rotations, 4) },
      ...{ opacities: cut(opacities, 1), sh: cut(sh, stride) },
      // The losses of the file are counted once.
      ...(first > 0 && { droppedCount: 0, warnings: [] }),
    };
  }
}

/** Fills an array from a file. @throws CommandError if the file ends before */
export function readAt(file, bytes, from) {
  for (let at = 0; at < bytes.length;) {
    const length = readSync(file, bytes, at, bytes.length - at, from + at);
    if (length === 0) throw new CommandError(`a file ended at byte ${from + at}: it has changed while it was read`);
    at += length;
  }
}
