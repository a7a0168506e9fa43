/** Polynomial of ISO 3309 for ZIP, gzip and PNG, with the lowest bit first. */
const POLYNOMIAL = 0xedb88320;
/** Number of bytes that each step processes, and number of tables. */
const SLICES = 4;

let tables: readonly Int32Array[] | undefined;

/** Returns the tables: entry b of table k is the remainder of byte b followed by k bytes of zeros. */
function makeTables(): readonly Int32Array[] {
  const first = Int32Array.from({ length: 256 }, (_, byte) => {
    for (let bit = 0; bit < 8; bit++) byte = (byte >>> 1) ^ (byte & 1 ? POLYNOMIAL : 0);
    return byte;
  });
  const made = [first];
  while (made.length < SLICES) made.push(made[made.length - 1].map((rest) => (rest >>> 8) ^ first[rest & 255]));
  return made;
}

/** Returns the CRC-32 of bytes as an unsigned integer. Processes four bytes in each step (Kounavis and Berry 2005). */
export function crc32(bytes: Uint8Array): number {
  const [t0, t1, t2, t3] = (tables ??= makeTables());
  let rest = -1;
  let i = 0;
  for (const end = bytes.length - 3; i < end; i += 4) {
    rest ^= bytes[i] | (bytes[i + 1] << 8) | (bytes[i + 2] << 16) | (bytes[i + 3] << 24);
    rest = t3[rest & 255] ^ t2[(rest >>> 8) & 255] ^ t1[(rest >>> 16) & 255] ^ t0[rest >>> 24];
  }
  for (; i < bytes.length; i++) rest = (rest >>> 8) ^ t0[(rest ^ bytes[i]) & 255];
  return ~rest >>> 0;
}
