/** Writes .ksplat files, every level, one section; shares no code with the reader. */
import type { GaussianCloud } from '@gaussian-splat/core';

/** IEEE half-precision bits of a number, to nearest. */
function half(value: number): number {
  const sign = value < 0 ? 0x8000 : 0;
  const magnitude = Math.abs(value);
  if (magnitude < 2 ** -14) return sign | Math.round(magnitude * 2 ** 24);
  const exponent = Math.min(15, Math.floor(Math.log2(magnitude)));
  return sign | Math.round((magnitude / 2 ** exponent - 1 + exponent + 15) * 1024);
}

export interface KsplatOptions {
  readonly level: 0 | 1 | 2;
  readonly bucketSize?: number;
}

export function writeKsplat(cloud: GaussianCloud, { level, bucketSize = 5 }: KsplatOptions): Uint8Array {
  const { count, shDegree } = cloud;
  const full = level === 0 ? 0 : Math.floor(count / bucketSize);
  const rest = level === 0 ? 0 : count % bucketSize;
  const buckets = full + (rest > 0 ? 1 : 0);
  const blockSize = 10;
  const out: number[] = [];
  const push = (bytes: Buffer): void => void out.push(...bytes);
  const float = (value: number): Buffer => {
    const bytes = Buffer.alloc(4);
    bytes.writeFloatLE(value);
    return bytes;
  };
  const uint16 = (value: number): Buffer => Buffer.from([value & 255, value >> 8]);
  const number = level === 0 ? float : (value: number): Buffer => uint16(half(value));

  const header = Buffer.alloc(4096);
  header[1] = 1;
  [1, 1, count, count].forEach((value, k) => header.writeUInt32LE(value, 4 + 4 * k));
  header.writeUInt16LE(level, 20);
  header.writeFloatLE(-1.5, 36);
  header.writeFloatLE(1.5, 40);
  const section = Buffer.alloc(1024);
  [count, count, bucketSize, buckets].forEach((value, k) => section.writeUInt32LE(value, 4 * k));
  section.writeFloatLE(blockSize, 16);
  section.writeUInt16LE(level === 0 ? 0 : 12, 20);
  section.writeUInt32LE(level === 0 ? 1 : 32_767, 24);
  section.writeUInt32LE(full, 32);
  section.writeUInt32LE(rest > 0 ? 1 : 0, 36);
  section.writeUInt16LE(shDegree, 40);

  const center = (bucket: number, axis: number): number => cloud.positions[3 * bucket * bucketSize + axis];
  if (rest > 0) push(Buffer.from(Uint32Array.of(rest).buffer));
  for (let b = 0; b < buckets; b++) for (let axis = 0; axis < 3; axis++) push(float(center(b, axis)));
  const stride = 3 * (shDegree + 1) ** 2;
  for (let i = 0; i < count; i++) {
    for (let axis = 0; axis < 3; axis++) {
      const value = cloud.positions[3 * i + axis];
      const offset = value - center(Math.floor(i / bucketSize), axis);
      push(level === 0 ? float(value) : uint16(Math.round((offset / (blockSize / 2)) * 32_767) + 32_767));
    }
    for (let axis = 0; axis < 3; axis++) push(number(cloud.scales[3 * i + axis]));
    for (let k = 0; k < 4; k++) push(number(cloud.rotations[4 * i + k]));
    const color = [0, 1, 2].map((k) => 0.5 + 0.28209479177387814 * cloud.sh[stride * i + k]);
    push(Buffer.from([...color, cloud.opacities[i]].map((value) => Math.round(255 * Math.min(1, Math.max(0, value))))));
    for (let band = 1; band <= shDegree; band++) {
      for (let channel = 0; channel < 3; channel++) {
        for (let k = band * band; k < (band + 1) ** 2; k++) {
          const value = cloud.sh[stride * i + 3 * k + channel];
          push(level < 2 ? number(value) : Buffer.from([Math.round((255 * (value + 1.5)) / 3)]));
        }
      }
    }
  }
  return new Uint8Array(Buffer.concat([header, section, Buffer.from(out)]));
}
