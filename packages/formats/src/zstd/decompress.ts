import { startsWith } from '../bytes.js';
import { ZstdError } from './bits.js';
import type { HuffmanTable } from './huffman.js';
import { littleEndian, MAX_BLOCK, readLiterals } from './literals.js';
import { executeSequences, type Output, type SequenceTables } from './sequences.js';

const FRAME_MAGIC = [0x28, 0xb5, 0x2f, 0xfd];

/**
 * Decompresses a Zstandard stream (RFC 8878) of one or more frames, with a content of exactly `length` bytes. It ends at
 * the first fault, so that the size of the stream and `length` bound time and memory. Checksums are not verified.
 *
 * @throws ZstdError with the byte of the stream at the fault.
 */
export function decompressZstd(bytes: Uint8Array, length: number): Uint8Array {
  const output: Output = { bytes: new Uint8Array(length), frameStart: 0, position: 0, repeatedOffsets: [1, 4, 8] };
  for (let at = 0; at < bytes.length;) {
    const isSkippable = startsWith(bytes, [0x2a, 0x4d, 0x18], at + 1) && bytes[at] >> 4 === 5;
    at = isSkippable ? at + 8 + littleEndian(bytes, at + 4, 4) : decompressFrame(bytes, at, output);
    if (at > bytes.length) throw new ZstdError('a frame that overruns the stream', bytes.length, true);
  }
  if (output.position !== length) {
    throw new ZstdError(`${output.position} bytes of content instead of ${length}`, bytes.length, true);
  }
  return output.bytes;
}

/** Decompresses the frame at byte `start`. Returns the byte offset after the frame. */
function decompressFrame(bytes: Uint8Array, start: number, output: Output): number {
  const { blocksStart, hasChecksum } = readFrameHeader(bytes, start, output.bytes.length - output.position);
  output.frameStart = output.position;
  output.repeatedOffsets.splice(0, 3, 1, 4, 8);
  let huffman: HuffmanTable | undefined;
  let tables: SequenceTables | undefined;
  let at = blocksStart;
  for (let isLast = false; !isLast;) {
    const header = littleEndian(bytes, at, 3);
    isLast = (header & 1) === 1;
    const type = (header >> 1) & 3;
    const size = header >> 3;
    const content = at + 3;
    const end = content + (type === 1 ? 1 : size);
    if (end > bytes.length) throw new ZstdError('a block that overruns the stream', bytes.length, true);
    if (size > MAX_BLOCK || type === 3) throw new ZstdError('a block of a reserved type or size', at);
    if (type < 2) {
      if (output.position + size > output.bytes.length) throw new ZstdError('more content than announced', at);
      if (type === 0) output.bytes.set(bytes.subarray(content, end), output.position);
      else output.bytes.fill(bytes[content], output.position, output.position + size);
      output.position += size;
    } else {
      const literals = readLiterals(bytes, content, end, huffman);
      huffman = literals.table;
      tables = executeSequences(bytes, literals.next, end, literals.content, output, tables);
    }
    at = end;
  }
  return at + (hasChecksum ? 4 : 0);
}

function readFrameHeader(
  bytes: Uint8Array,
  start: number,
  room: number,
): { blocksStart: number; hasChecksum: boolean } {
  if (!startsWith(bytes, FRAME_MAGIC, start)) {
    const isCut = bytes.length < start + 4;
    throw new ZstdError('no Zstandard frame', start, isCut);
  }
  const descriptor = bytes[start + 4] ?? 0;
  const isSingleSegment = (descriptor & 32) !== 0;
  const dictionaryBytes = [0, 1, 2, 4][descriptor & 3];
  const sizeBytes = [isSingleSegment ? 1 : 0, 2, 4, 8][descriptor >> 6];
  const dictionaryAt = start + 5 + (isSingleSegment ? 0 : 1);
  const sizeAt = dictionaryAt + dictionaryBytes;
  if (sizeAt + sizeBytes > bytes.length) throw new ZstdError('a frame header that is cut', bytes.length, true);
  if ((descriptor & 8) !== 0) throw new ZstdError('reserved bits that are set', start + 4);
  if (littleEndian(bytes, dictionaryAt, dictionaryBytes) !== 0) {
    throw new ZstdError('a frame that needs a dictionary', dictionaryAt);
  }
  const size = littleEndian(bytes, sizeAt, sizeBytes) + (sizeBytes === 2 ? 256 : 0);
  if (sizeBytes > 0 && size > room) throw new ZstdError(`a frame of ${size} bytes where ${room} belong`, sizeAt);
  return { blocksStart: sizeAt + sizeBytes, hasChecksum: (descriptor & 4) !== 0 };
}
