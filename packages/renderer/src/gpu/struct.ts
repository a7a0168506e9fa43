/** Byte layout of a WGSL struct, which scripts/build-shaders.mjs generates. */
export interface StructLayout {
  readonly size: number;
  readonly fields: Readonly<Record<string, { readonly offset: number; readonly type: string }>>;
}

export type StructValues<L extends StructLayout> = Readonly<Record<keyof L['fields'], number | ArrayLike<number>>>;

/**
 * Writes a struct to `target` at a byte offset, a multiple of 4. Fields of the types `u32` and `i32`, and their
 * vectors, are written as integers; all other fields as float32.
 */
export function writeStruct<L extends StructLayout>(
  layout: L,
  values: StructValues<L>,
  target: ArrayBuffer,
  byteOffset = 0,
): void {
  const floats = new Float32Array(target, byteOffset, layout.size / 4);
  const integers = new Uint32Array(target, byteOffset, layout.size / 4);
  for (const [name, { offset, type }] of Object.entries(layout.fields)) {
    const value = values[name as keyof L['fields']];
    const target32 = /^([ui]32|vec\d[ui])$/.test(type) ? integers : floats;
    if (typeof value === 'number') target32[offset / 4] = value;
    else target32.set(value, offset / 4);
  }
}
