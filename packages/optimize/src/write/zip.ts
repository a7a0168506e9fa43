import { fileBytes, MAX_UINT32, requireAtMost } from './file-bytes.js';

/** Signatures of a file's local header, of its entry in the central directory, and of the end of the directory. */
const LOCAL = 0x04034b50;
const CENTRAL = 0x02014b50;
const END = 0x06054b50;
/** Version 2.0 of ZIP; and the date 1980-01-01, so that archives of the same files are identical. */
const VERSION = 20;
const DATE = 0x21;
/** Maximum number of files of an archive without the extension ZIP64. */
const MAX_FILES = 65_535;

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let code = byte;
  for (let bit = 0; bit < 8; bit++) code = code & 1 ? (code >>> 1) ^ 0xedb88320 : code >>> 1;
  return code;
});

function crc32(bytes: Uint8Array): number {
  let code = 0xffffffff;
  for (const byte of bytes) code = CRC_TABLE[(code ^ byte) & 255] ^ (code >>> 8);
  return ~code >>> 0;
}

/** Extra field whose only purpose is its length, and the bytes of its type and length. */
const [PADDING, PADDING_HEAD] = [0x1986, 4];

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
  const entries = [...files].map(([name, bytes]) => ({ name: new TextEncoder().encode(name), bytes, padding: 0 }));
  let total = 0;
  for (const entry of entries) {
    entry.padding = paddingOf(total + 30 + entry.name.length, alignment);
    total += 30 + entry.name.length + entry.padding + entry.bytes.length;
  }
  total += entries.reduce((sum, { name }) => sum + 46 + name.length, 22);
  requireAtMost(format, entries.length, MAX_FILES, 'files in its ZIP archive');
  requireAtMost(format, total, MAX_UINT32, 'bytes in its ZIP archive');
  const zip = fileBytes(format, total);
  const view = new DataView(zip.buffer);
  let at = 0;
  const put = (fields: readonly (readonly [bytes: 2 | 4, value: number])[]): void => {
    for (const [size, value] of fields) {
      if (size === 2) view.setUint16(at, value, true);
      else view.setUint32(at, value, true);
      at += size;
    }
  };
  const append = (bytes: Uint8Array): void => {
    zip.set(bytes, at);
    at += bytes.length;
  };
  const places = entries.map(({ name, bytes, padding }) => {
    const place = at;
    put([[4, LOCAL], [2, VERSION], ...factsOf(name, bytes, padding)]);
    append(name);
    if (padding > 0)
      put([
        [2, PADDING],
        [2, padding - PADDING_HEAD],
      ]);
    at = place + 30 + name.length + padding;
    append(bytes);
    return place;
  });
  const start = at;
  entries.forEach(({ name, bytes }, k) => {
    put([[4, CENTRAL], [2, VERSION], [2, VERSION], ...factsOf(name, bytes)]);
    // No comment, first disk, no attributes.
    put([
      [2, 0],
      [2, 0],
      [2, 0],
      [4, 0],
      [4, places[k]],
    ]);
    append(name);
  });
  const length = at - start;
  put([
    [4, END],
    [2, 0],
    [2, 0],
    [2, entries.length],
    [2, entries.length],
    [4, length],
    [4, start],
    [2, 0],
  ]);
  return zip;
}

/**
 * Returns the fields that both headers of a file have: flags (the name is UTF-8), method, time, date, checksum, two
 * sizes, and the lengths of the name and of the extra field.
 */
function factsOf(name: Uint8Array, bytes: Uint8Array, padding = 0): (readonly [2 | 4, number])[] {
  return [
    [2, 0x800],
    [2, 0],
    [2, 0],
    [2, DATE],
    [4, crc32(bytes)],
    [4, bytes.length],
    [4, bytes.length],
    [2, name.length],
    [2, padding],
  ];
}

/** Bytes of the extra field that move content from `at` to a multiple of `alignment`. */
function paddingOf(at: number, alignment: number): number {
  const gap = (alignment - (at % alignment)) % alignment;
  return gap > 0 && gap < PADDING_HEAD ? gap + alignment : gap;
}

/** Returns the files of an archive that {@link writeZip} wrote, by name. They share the memory of the archive. */
export function filesOfZip(zip: Uint8Array): Map<string, Uint8Array> {
  const view = new DataView(zip.buffer, zip.byteOffset, zip.byteLength);
  const files = new Map<string, Uint8Array>();
  for (let at = 0; view.getUint32(at, true) === LOCAL;) {
    const [length, nameLength] = [view.getUint32(at + 22, true), view.getUint16(at + 26, true)];
    const first = at + 30 + nameLength + view.getUint16(at + 28, true);
    files.set(
      new TextDecoder().decode(zip.subarray(at + 30, at + 30 + nameLength)),
      zip.subarray(first, first + length),
    );
    at = first + length;
  }
  return files;
}
