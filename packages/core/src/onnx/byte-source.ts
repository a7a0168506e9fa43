/** A file that can be read in pieces, wherever it lies. */
export interface ByteSource {
  /** Name for messages: a file name or an address. */
  readonly name: string;
  /** Length in bytes. */
  readonly size: number;
  /** Bytes worth asking for at once: all of them in memory, some kilobytes over a network. */
  readonly chunk: number;
  /** The bytes from `offset` on: `length` of them, or fewer where the file ends. Never more, never beyond the end. */
  read(offset: number, length: number): Promise<Uint8Array>;
}

/** A file in memory. Nothing is copied. */
export function bytesSource(bytes: Uint8Array, name = 'model.onnx'): ByteSource {
  return {
    name,
    size: bytes.length,
    chunk: Math.max(1, bytes.length),
    read: (offset, length) => Promise.resolve(bytes.subarray(offset, offset + length)),
  };
}

/** A `File` that was dropped on a page, or any `Blob`: only the pieces that are asked for are read. */
export function blobSource(blob: Blob, name = 'name' in blob ? String(blob.name) : 'model.onnx'): ByteSource {
  return {
    name,
    size: blob.size,
    chunk: 65_536,
    read: async (offset, length) => new Uint8Array(await blob.slice(offset, offset + length).arrayBuffer()),
  };
}
