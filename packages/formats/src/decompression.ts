/** Number of compressed bytes that are written in one step. They may inflate to 17 MB before the stream can be stopped. */
const STEP_BYTES = 16_384;

/**
 * Starts decompressing bytes. The reader reports errors of the stream; canceling it stops the decompression. The bytes
 * are written in steps, because browsers inflate all bytes of one write at once.
 */
export function decompressing(
  bytes: Uint8Array,
  format: CompressionFormat,
): ReadableStreamDefaultReader<Uint8Array<ArrayBuffer>> {
  const { readable, writable } = new DecompressionStream(format);
  feed(writable.getWriter(), bytes).catch(() => {});
  return readable.getReader();
}

async function feed(writer: WritableStreamDefaultWriter<BufferSource>, bytes: Uint8Array): Promise<void> {
  for (let at = 0; at < bytes.length; at += STEP_BYTES) await writer.write(bytes.slice(at, at + STEP_BYTES));
  await writer.close();
}
