import { GaussianSplatError } from '@gaussian-splat/core';
import type { LoadBudget } from '../budget.js';
import { grouped, quote, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import { inflateUpTo } from '../inflate.js';
import type { SceneSource } from '../scene-format.js';
import { crc32 } from './crc32.js';
import { readDirectory, type ZipEntry } from './directory.js';

/** Maximum compression ratio of deflate. */
const MAX_COMPRESSION_RATIO = 1032;
const HEADER = 0x04034b50;
const HEADER_BYTES = 30;
const [STORED, DEFLATED] = [0, 8];

/** A ZIP file whose files are inflated on demand. */
export class Archive {
  readonly #file: Uint8Array;
  readonly #name: string;
  readonly #budget: LoadBudget;
  readonly #entries = new Map<string, ZipEntry>();

  /** Reads the directory of the archive. Throws `decode/corrupt`, `decode/truncated` or `decode/unsupported`. */
  constructor({ bytes, name, budget }: Pick<SceneSource, 'bytes' | 'name' | 'budget'>) {
    this.#file = bytes;
    this.#name = name;
    this.#budget = budget;
    for (const entry of readDirectory(bytes, name)) {
      const path = normalized(entry.path);
      if (!isFolder(entry.path) && !this.#entries.has(path)) this.#entries.set(path, entry);
    }
  }

  /** Paths of all files, with `/` between folders. */
  get paths(): string[] {
    return [...this.#entries.keys()];
  }

  /** Returns the inflated size of a file in bytes, as the directory declares; 0 if the file is missing. */
  lengthOf(path: string): number {
    return this.#entries.get(normalized(path))?.bytes ?? 0;
  }

  /**
   * Returns the content of a file. Do not modify it, because it may be memory of the archive.
   * @param path Path of the file in the archive. It may contain `.` and `..`.
   * @throws GaussianSplatError `decode/corrupt`, also for missing files; `decode/unsupported`, `out-of-memory/budget`
   */
  open(path: string): Uint8Array {
    const entry = this.#entries.get(normalized(path));
    if (!entry) throw this.#missing(path);
    const where = `${this.#name}, ${path}`;
    if (entry.isEncrypted) throw damaged(where, 'a file without a password', 'an encrypted one', 'decode/unsupported');
    if (entry.method !== STORED && entry.method !== DEFLATED) {
      const found = `compression method ${entry.method}`;
      throw damaged(where, 'a file that is stored or deflated', found, 'decode/unsupported');
    }
    // The declared size is checked, because a directory may declare any size.
    const there = Math.min(entry.compressedBytes, this.#file.length);
    if (entry.bytes > MAX_COMPRESSION_RATIO * there + 64) {
      const found = `${grouped(entry.bytes)} bytes out of ${grouped(there)}`;
      throw damaged(where, 'a size that deflate can reach', found);
    }
    // Stored content is charged, too, because the checksum reads all bytes.
    this.#budget.take(entry.bytes, where);
    const content = this.#contentOf(entry, where);
    if (content.length !== entry.bytes) throw damaged(where, `${grouped(entry.bytes)} bytes`, grouped(content.length));
    // Some programs write 0, because they do not know the checksum before they write the content.
    if (entry.crc === 0) return content;
    const crc = crc32(content);
    if (crc === entry.crc) return content;
    throw damaged(where, `the content that was packed (CRC-32 ${hex(entry.crc)})`, `another (${hex(crc)})`);
  }

  #contentOf({ method, headerAt, compressedBytes, bytes }: ZipEntry, where: string): Uint8Array {
    const view = viewOf(this.#file);
    const isThere = headerAt + HEADER_BYTES <= view.byteLength && view.getUint32(headerAt, true) === HEADER;
    if (!isThere) throw damaged(where, `the file at byte ${grouped(headerAt)}`, 'something else');
    const start = headerAt + HEADER_BYTES + view.getUint16(headerAt + 26, true) + view.getUint16(headerAt + 28, true);
    const stored = this.#file.subarray(start, start + compressedBytes);
    if (method === STORED) return stored;
    try {
      return inflateUpTo(stored, bytes);
    } catch (cause) {
      if (cause instanceof RangeError) throw cause;
      throw damaged(where, 'an intact deflate stream', (cause as Error).message || 'damage', 'decode/corrupt', cause);
    }
  }

  #missing(path: string): GaussianSplatError {
    return new GaussianSplatError('decode/corrupt', {
      where: `${this.#name}, ${quote(path)}`,
      expected: 'the file that the scene names',
      found: `${this.#entries.size} other files in the archive`,
      remedy: 'pack the whole folder of the scene, with all files',
    });
  }
}

const hex = (value: number): string => value.toString(16).padStart(8, '0');

const isFolder = (path: string): boolean => /[\\/]$/.test(path);

/** Resolves `.`, `..` and backslashes of a path. The result has `/` between folders, and is within the archive. */
function normalized(path: string): string {
  const parts: string[] = [];
  for (const part of path.replaceAll('\\', '/').split('/')) {
    if (part === '..') parts.pop();
    else if (part !== '.' && part !== '') parts.push(part);
  }
  return parts.join('/');
}
