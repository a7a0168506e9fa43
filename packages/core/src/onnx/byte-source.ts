/** A file in any location that can be read in ranges. */
export interface ByteSource {
  /** Name for messages: a file name or an address. */
  readonly name: string;
  /** Length in bytes. */
  readonly size: number;
  /** Suggested number of bytes of a read: the whole file in memory, some kilobytes over a network. */
  readonly chunk: number;
  /** Resolves to `length` bytes from `offset` on, or fewer at the end of the file. */
  read(offset: number, length: number): Promise<Uint8Array>;
}

/** Returns the source of a file in memory, whose bytes are not copied. */
export function bytesSource(bytes: Uint8Array, name = 'model.onnx'): ByteSource {
  return {
    name,
    size: bytes.length,
    chunk: Math.max(1, bytes.length),
    read: (offset, length) => Promise.resolve(bytes.subarray(offset, offset + length)),
  };
}

/** Returns the source of a `File` or any other `Blob`. Only the requested ranges are read. */
export function blobSource(blob: Blob, name = 'name' in blob ? String(blob.name) : 'model.onnx'): ByteSource {
  return {
    name,
    size: blob.size,
    chunk: 65_536,
    read: async (offset, length) => new Uint8Array(await blob.slice(offset, offset + length).arrayBuffer()),
  };
}
