/** Every buffer of some plain objects once: transferred, data of any size changes threads at no cost. */
export function buffersOf(...parts: readonly object[]): ArrayBuffer[] {
  const buffers = parts
    .flatMap((part) => Object.values(part))
    .filter((value): value is ArrayBufferView<ArrayBuffer> => ArrayBuffer.isView(value))
    .map((view) => view.buffer);
  return [...new Set(buffers)];
}
