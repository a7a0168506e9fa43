/** Pieces of a deflate stream that compress nothing, for places without zlib: blocks of at most 65,535 bytes, none of them the last. */
export function storedBlocks(bytes: Uint8Array): Uint8Array {
  const max = 65_535;
  const blocks = Math.max(1, Math.ceil(bytes.length / max));
  const out = new Uint8Array(bytes.length + 5 * blocks);
  let at = 0;
  for (let k = 0; k < blocks; k++) {
    const block = bytes.subarray(max * k, max * (k + 1));
    const length = block.length;
    out.set([0, length & 255, length >> 8, ~length & 255, (~length >> 8) & 255], at);
    out.set(block, at + 5);
    at += 5 + length;
  }
  return out;
}
