/** Input files of commands. */
import { readFileSync } from 'node:fs';
import { open } from 'node:fs/promises';

/** Bytes of one read: Node's thread pool then shares the work, and no read exceeds its limit. */
const PIECE = 1 << 26;

/**
 * Reads a file's bytes asynchronously: many times as fast as `readFile` of `node:fs/promises`, which reads half a
 * megabyte at a time.
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

/** Fills the array from a file. */
async function fill(file, bytes, from) {
  for (let at = 0; at < bytes.length;) {
    const { bytesRead } = await file.read(bytes, at, bytes.length - at, from + at);
    if (bytesRead === 0) throw new Error(`the file ended at byte ${from + at}: it has changed while it was read`);
    at += bytesRead;
  }
}

/** Parses a JSON file, with or without the byte-order mark that some editors and shells add. */
export function readJson(path) {
  return JSON.parse(readFileSync(path, 'utf8').replace(/^\ufeff/, ''));
}
