import { GaussianSplatError } from '@gaussian-splat/core';
import { unzipSync } from 'fflate';
import { grouped, quote, viewOf } from '../bytes.js';
import { damaged } from '../damaged.js';

/** Deflate cannot compress better than this. */
const MAX_COMPRESSION_RATIO = 1032;
/** Entries of an archive; a streamed scene of 50 million splats has some thousands. */
const MAX_ENTRIES = 100_000;
const DIRECTORY_END = 0x06054b50;
const DIRECTORY_END_BYTES = 22;

/** A file within an archive. */
interface Entry {
  readonly path: string;
  readonly compressedBytes: number;
  readonly bytes: number;
}

/** A ZIP file whose entries are inflated one at a time, when they are asked for. */
export class Archive {
  readonly #bytes: Uint8Array;
  readonly #name: string;
  readonly #entries = new Map<string, Entry>();

  /** Reads the directory. Throws `decode/corrupt`, `decode/truncated` or `decode/unsupported`. */
  constructor(bytes: Uint8Array, name: string) {
    this.#bytes = bytes;
    this.#name = name;
    requireDirectory(bytes, name);
    this.#guarded(() =>
      unzipSync(bytes, {
        filter: ({ name: path, size, originalSize }) => {
          if (!path.endsWith('/')) this.#add({ path, compressedBytes: size, bytes: originalSize });
          return false;
        },
      }),
    );
  }

  /** Paths of all files, as the archive writes them. */
  get paths(): string[] {
    return [...this.#entries.keys()];
  }

  /** The content of a file. `path` may have `.` and `..` in it. */
  open(path: string): Uint8Array {
    const entry = this.#entries.get(normalised(path));
    if (!entry) throw this.#missing(path);
    if (entry.bytes > MAX_COMPRESSION_RATIO * entry.compressedBytes + 64) {
      const found = `${grouped(entry.bytes)} bytes out of ${grouped(entry.compressedBytes)}`;
      throw damaged(`${this.#name}, ${path}`, 'a size that deflate can reach', found);
    }
    let isTaken = false;
    const files = this.#guarded(() =>
      unzipSync(this.#bytes, {
        filter: (file) => {
          // Two entries of one name would both be inflated.
          if (isTaken || normalised(file.name) !== normalised(path)) return false;
          return (isTaken = true);
        },
      }),
    );
    const content = Object.values(files)[0];
    if (content?.length === entry.bytes) return content;
    throw damaged(`${this.#name}, ${path}`, `${grouped(entry.bytes)} bytes`, grouped(content?.length ?? 0));
  }

  #add(entry: Entry): void {
    if (this.#entries.size >= MAX_ENTRIES) {
      throw damaged(this.#name, `at most ${grouped(MAX_ENTRIES)} files`, 'more', 'decode/unsupported');
    }
    const path = normalised(entry.path);
    if (!this.#entries.has(path)) this.#entries.set(path, entry);
  }

  /** fflate's errors have words, but not the file's name. */
  #guarded<T>(work: () => T): T {
    try {
      return work();
    } catch (cause) {
      if (cause instanceof GaussianSplatError) throw cause;
      throw damaged(this.#name, 'an intact ZIP file', (cause as Error).message || 'damage', 'decode/corrupt', cause);
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

/** The directory stands at the end: without it the file is cut. */
function requireDirectory(bytes: Uint8Array, name: string): void {
  const view = viewOf(bytes);
  const first = Math.max(0, bytes.length - DIRECTORY_END_BYTES - 65_535);
  for (let at = bytes.length - DIRECTORY_END_BYTES; at >= first; at--) {
    if (view.getUint32(at, true) === DIRECTORY_END) return;
  }
  throw damaged(
    `${name}, byte ${grouped(bytes.length)} (end of the file)`,
    'the directory of a ZIP file',
    'none',
    'decode/truncated',
  );
}

/** A path without `.` and `..`, which stay within the archive. */
export function normalised(path: string): string {
  const parts: string[] = [];
  for (const part of path.replaceAll('\\', '/').split('/')) {
    if (part === '..') parts.pop();
    else if (part !== '.' && part !== '') parts.push(part);
  }
  return parts.join('/');
}
