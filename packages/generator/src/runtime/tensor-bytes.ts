/** Bytes of one element of the element types that inputs and outputs of generators have. */
export const ELEMENT_BYTES: Readonly<Record<string, number>> = { float32: 4, int32: 4, float16: 2, int64: 8 };

/** Bytes of a GPU buffer for a tensor: the runtime copies in pieces of 16. */
export function bufferBytes(dtype: string, elements: number): number {
  return Math.max(16, Math.ceil((elements * ELEMENT_BYTES[dtype]) / 16) * 16);
}

/** `GPUBufferUsage`, which does not exist where a module is merely imported: STORAGE, COPY_SRC and COPY_DST. */
export const TENSOR_USAGE = 0x80 | 0x4 | 0x8;
