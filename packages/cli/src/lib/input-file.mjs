/** Readers of the input files of commands. */
import { readFileSync } from 'node:fs';
import { open } from 'node:fs/promises';
import { dirname, join, posix } from 'node:path';
import { GaussianSplatError } from '@gaussian-splat/core';
import { isInside } from '@gaussian-splat/core/contract';
import { CommandError, UsageError } from './command.mjs';

/** Maximum bytes of a read, so that the threads of Node's pool read in parallel, and no read exceeds the limit of Node. */
const PIECE = 1 << 26;

/**
 * Returns the bytes of a file. This is many times as fast as `readFile` of `node:fs/promises`, which reads half a megabyte
 * at a time.
 */
export async function readWhole(path) {
  const file = await open(path);
  try {
    const { size } = await file.stat();
    const bytes = new Uint8Array(size);
    const pieces = Array.from({ length: Math.ceil(size / PIECE) }, (_, k) => k * PIECE);
    await Promise.all(pieces.map((at) => fill(file, bytes.subarray(at, at + PIECE), at)));
    return bytes;
  } finally {
    await file.close();
  }
}

/**
 * Returns the reader of the files that a scene names, by their paths relative to its folder. Scenes may be untrusted, so
 * that none may name a file of the machine outside of its folder.
 */
export function readerBeside(scene) {
  return async (part) => {
    if (isInside(posix.normalize(part))) return readWhole(join(dirname(scene), part));
    throw new GaussianSplatError('decode/unsupported', {
      where: scene,
      expected: 'names of files in the folder of the scene',
      found: JSON.stringify(part),
      remedy: 'copy the file into this folder, and correct its name in the scene',
    });
  };
}

/** Fills an array with bytes of a file, from the offset `from` on. Throws if the file ends before. */
async function fill(file, bytes, from) {
  for (let at = 0; at < bytes.length;) {
    const { bytesRead } = await file.read(bytes, at, bytes.length - at, from + at);
    if (bytesRead === 0)
      throw new CommandError(`the file ended at byte ${from + at}: it has changed while it was read`);
    at += bytesRead;
  }
}

/** Parses a JSON file, which may begin with a byte-order mark. @throws UsageError for other text */
export function readJson(path) {
  const text = readFileSync(path, 'utf8').replace(/^\ufeff/, '');
  try {
    return JSON.parse(text);
  } catch (error) {
    throw new UsageError(`${path} is not JSON: ${error.message}`);
  }
}
