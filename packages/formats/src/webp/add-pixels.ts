/** Sum of each of the four bytes, modulo 256. */
export function addPixels(a: number, b: number): number {
  return (
    ((((a & 0xff00ff00) >>> 0) + ((b & 0xff00ff00) >>> 0)) & 0xff00ff00) |
    (((a & 0x00ff00ff) + (b & 0x00ff00ff)) & 0x00ff00ff)
  );
}
