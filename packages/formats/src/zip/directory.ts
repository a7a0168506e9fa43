import { grouped, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';

/** A file of an archive, as the directory describes it. `bytes` is its inflated size. */
export interface ZipEntry {
  /** Path of the file, not normalized. */
  readonly path: string;
  /** Compression method: 0 stored, 8 deflate. */
  readonly method: number;
  readonly isEncrypted: boolean;
  readonly compressedBytes: number;
  readonly bytes: number;
  /** CRC-32 of the inflated content; 0 if the writer did not know it. */
  readonly crc: number;
  /** Byte offset in the archive of the file's header, which precedes its content. */
  readonly headerAt: number;
}

const DIRECTORY_END = 0x06054b50;
const DIRECTORY_END_BYTES = 22;
const DIRECTORY_END_64 = 0x06064b50;
const LOCATOR_64 = 0x07064b50;
const LOCATOR_64_BYTES = 20;
const ENTRY = 0x02014b50;
const ENTRY_BYTES = 46;
/** Maximum number of entries. A streamed scene of 50 million splats has a few thousand. */
const MAX_ENTRIES = 100_000;
/** Value of a 32-bit field that is replaced by a field of 64 bits. */
const ELSEWHERE = 0xffffffff;
const FLAG_ENCRYPTED = 1;
const FLAG_UTF8 = 0x800;

const utf8 = new TextDecoder('utf-8', { fatal: true });
const latin1 = new TextDecoder('latin1');

/** Reads all entries of a ZIP file's directory. Throws `decode/corrupt`, `decode/truncated` or `decode/unsupported`. */
export function readDirectory(file: Uint8Array, name: string): ZipEntry[] {
  const view = viewOf(file);
  const { count, start } = findDirectory(view, name);
  if (count > MAX_ENTRIES) {
    throw damaged(name, `at most ${grouped(MAX_ENTRIES)} files`, grouped(count), 'decode/unsupported');
  }
  const entries: ZipEntry[] = [];
  for (let at = start; entries.length < count;) {
    if (at + ENTRY_BYTES > file.length || view.getUint32(at, true) !== ENTRY) {
      const found = `${grouped(entries.length)} of ${grouped(count)}`;
      throw damaged(`${name}, byte ${grouped(at)}`, 'an entry of the directory of a ZIP file', found);
    }
    const [nameBytes, extraBytes, commentBytes] = [28, 30, 32].map((field) => view.getUint16(at + field, true));
    entries.push(readEntry(file, view, at, at + ENTRY_BYTES + nameBytes, extraBytes));
    at += ENTRY_BYTES + nameBytes + extraBytes + commentBytes;
  }
  return entries;
}

/**
 * Returns the number of entries in the directory, and its byte offset. The record with these numbers is at the end of the
 * file, before a comment. Throws `decode/truncated` if it is missing.
 */
function findDirectory(view: DataView, name: string): { count: number; start: number } {
  const last = view.byteLength - DIRECTORY_END_BYTES;
  const ends: number[] = [];
  for (let at = last; at >= Math.max(0, last - 65_535); at--) {
    if (view.getUint32(at, true) === DIRECTORY_END) ends.push(at);
  }
  // A comment may contain the same signature. The comment of the actual record ends at the end of the file.
  const end =
    ends.find((at) => at + DIRECTORY_END_BYTES + view.getUint16(at + 20, true) === view.byteLength) ?? ends[0];
  if (end === undefined) {
    const where = `${name}, byte ${grouped(view.byteLength)} (end of the file)`;
    throw damaged(where, 'the directory of a ZIP file', 'none', 'decode/truncated');
  }
  const locator = end - LOCATOR_64_BYTES;
  if (locator >= 0 && view.getUint32(locator, true) === LOCATOR_64) {
    const at = longAt(view, locator + 8);
    if (at + 56 <= end && view.getUint32(at, true) === DIRECTORY_END_64) {
      return { count: longAt(view, at + 32), start: longAt(view, at + 48) };
    }
  }
  return { count: view.getUint16(end + 10, true), start: view.getUint32(end + 16, true) };
}

function readEntry(file: Uint8Array, view: DataView, at: number, nameEnd: number, extraBytes: number): ZipEntry {
  const flags = view.getUint16(at + 8, true);
  const [compressedBytes, bytes, headerAt] = [20, 24, 42].map((field) => view.getUint32(at + field, true));
  const long = longNumbers(view, nameEnd, Math.min(file.length, nameEnd + extraBytes));
  // The 64-bit fields are in this order, without those that a 32-bit field can represent.
  const [bytes64, compressed64, header64] = [bytes, compressedBytes, headerAt].map((value) =>
    value === ELSEWHERE ? (long.shift() ?? value) : value,
  );
  return {
    path: pathOf(file.subarray(at + ENTRY_BYTES, nameEnd), (flags & FLAG_UTF8) !== 0),
    method: view.getUint16(at + 10, true),
    isEncrypted: (flags & FLAG_ENCRYPTED) !== 0,
    compressedBytes: compressed64,
    bytes: bytes64,
    crc: view.getUint32(at + 16, true),
    headerAt: header64,
  };
}

/** Returns the 64-bit integers of the extra field 1 (ZIP64); an empty array without it. */
function longNumbers(view: DataView, start: number, end: number): number[] {
  for (let at = start; at + 4 <= end; at += 4 + view.getUint16(at + 2, true)) {
    if (view.getUint16(at, true) !== 1) continue;
    const count = Math.floor(Math.min(view.getUint16(at + 2, true), end - at - 4) / 8);
    return Array.from({ length: count }, (_, k) => longAt(view, at + 4 + 8 * k));
  }
  return [];
}

/** Decodes a path as UTF-8, which macOS writes even without the flag. Without the flag, invalid UTF-8 is Latin-1. */
function pathOf(bytes: Uint8Array, isUtf8: boolean): string {
  try {
    return utf8.decode(bytes);
  } catch {
    return isUtf8 ? new TextDecoder().decode(bytes) : latin1.decode(bytes);
  }
}

function longAt(view: DataView, at: number): number {
  return view.getUint32(at, true) + 2 ** 32 * view.getUint32(at + 4, true);
}
