import { strToU8, unzipSync, zipSync, type ZippableFile } from 'fflate';
import { fileBytes, MAX_UINT32, requireAtMost } from './file-bytes.js';

/** Maximum number of files of an archive without the extension ZIP64. */
const MAX_FILES = 65_535;
/** Bytes of a file's local header, of its entry in the directory, and of the end, without names and extra fields. */
const [LOCAL_BYTES, ENTRY_BYTES, END_BYTES] = [30, 46, 22];
/** Extra field whose only purpose is its length, and the bytes of its type and length. */
const [PADDING, PADDING_HEAD] = [0x1986, 4];
/** One date for all files, so that archives of the same files are identical. */
const DATE = new Date(1980, 0, 1);

/**
 * Writes a ZIP archive without compression, because the files are already compressed.
 * @param files Bytes of the files by name.
 * @param format Name of the format for errors.
 * @param alignment The offset of the content of each file is a multiple of it.
 * @throws GaussianSplatError `argument/value` for more than ZIP holds without ZIP64, before the allocation;
 * `out-of-memory/allocation`
 */
export function writeZip(
  files: ReadonlyMap<string, Uint8Array>,
  format = 'SOG',
  alignment = 1,
): Uint8Array<ArrayBuffer> {
  requireAtMost(format, files.size, MAX_FILES, 'files in its ZIP archive');
  const entries: Record<string, ZippableFile> = {};
  let [at, directory] = [0, END_BYTES];
  for (const [name, bytes] of files) {
    const { length } = strToU8(name);
    const padding = paddingOf(at + LOCAL_BYTES + length, alignment);
    const extra = padding > 0 ? { [PADDING]: new Uint8Array(padding - PADDING_HEAD) } : {};
    entries[name] = [bytes, { level: 0, mtime: DATE, extra }];
    at += LOCAL_BYTES + length + padding + bytes.length;
    directory += ENTRY_BYTES + length + padding;
  }
  requireAtMost(format, at + directory, MAX_UINT32, 'bytes in its ZIP archive');
  return fileBytes(format, at + directory, () => zipSync(entries).buffer as ArrayBuffer);
}

/** Bytes of the extra field that move content from `at` to a multiple of `alignment`. */
function paddingOf(at: number, alignment: number): number {
  const gap = (alignment - (at % alignment)) % alignment;
  return gap > 0 && gap < PADDING_HEAD ? gap + alignment : gap;
}

/** Returns the files of an archive that {@link writeZip} wrote, by name. */
export const filesOfZip = (zip: Uint8Array): Map<string, Uint8Array> => new Map(Object.entries(unzipSync(zip)));
