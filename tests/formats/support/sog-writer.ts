/** Writes SOG scenes of both versions from clouds; shares no code with the reader. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { writeWebp } from './webp-writer.js';

export type SogFiles = Record<string, Uint8Array>;

const WIDTH = 64;
const logPosition = (x: number): number => Math.sign(x) * Math.log1p(Math.abs(x));
const range = (values: number[]): [number, number] => [
  values.reduce((a, b) => Math.min(a, b), Infinity),
  values.reduce((a, b) => Math.max(a, b), -Infinity),
];

/** 256 values at equal fractions of the sorted numbers, and the nearest of them for each number. */
function quantize(numbers: readonly number[]): { codebook: number[]; codes: number[] } {
  const sorted = [...numbers].sort((a, b) => a - b);
  const codebook = Array.from({ length: 256 }, (_, k) => sorted[Math.round((k / 255) * (sorted.length - 1))]);
  const codes = numbers.map((value) => {
    let [low, high] = [0, 255];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (codebook[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low > 0 && value - codebook[low - 1] < codebook[low] - value ? low - 1 : low;
  });
  return { codebook, codes };
}

/** An image with one pixel for each splat. */
function plane(count: number, pixel: (i: number) => readonly number[]): Uint8Array {
  const height = Math.ceil(count / WIDTH);
  const rgba = new Uint8Array(4 * WIDTH * height);
  for (let i = 0; i < count; i++) rgba.set(pixel(i), 4 * i);
  return writeWebp(rgba, WIDTH, height);
}

function means({ count, positions }: GaussianCloud): {
  mins: number[];
  maxs: number[];
  low: Uint8Array;
  high: Uint8Array;
} {
  const logs = Array.from(positions, logPosition);
  const bounds = [0, 1, 2].map((axis) => range(logs.filter((_, k) => k % 3 === axis)));
  const code = (i: number, axis: number): number => {
    const [min, max] = bounds[axis];
    return Math.round((65_535 * (logs[3 * i + axis] - min)) / (max - min || 1));
  };
  return {
    mins: bounds.map(([min]) => min),
    maxs: bounds.map(([, max]) => max),
    low: plane(count, (i) => [...[0, 1, 2].map((axis) => code(i, axis) & 255), 255]),
    high: plane(count, (i) => [...[0, 1, 2].map((axis) => code(i, axis) >> 8), 255]),
  };
}

function quats({ count, rotations }: GaussianCloud): Uint8Array {
  return plane(count, (i) => {
    const q = Array.from(rotations.subarray(4 * i, 4 * i + 4));
    const largest = q.reduce((best, value, k) => (Math.abs(value) > Math.abs(q[best]) ? k : best), 0);
    const sign = Math.sign(q[largest]) || 1;
    const others = q.filter((_, k) => k !== largest);
    return [...others.map((value) => Math.round((value * sign * Math.SQRT2 + 1) * 127.5)), 252 + largest];
  });
}

/** SOG version 2; every splat has its own entry of the palette. */
export function writeSog(cloud: GaussianCloud): SogFiles {
  const { count, shDegree } = cloud;
  const coefficients = (shDegree + 1) ** 2 - 1;
  const stride = 3 * (coefficients + 1);
  const { mins, maxs, low, high } = means(cloud);
  const scales = quantize(Array.from(cloud.scales, Math.log));
  const colors = quantize(Array.from({ length: 3 * count }, (_, k) => cloud.sh[stride * Math.floor(k / 3) + (k % 3)]));
  const files: SogFiles = {
    'means_l.webp': low,
    'means_u.webp': high,
    'scales.webp': plane(count, (i) => [...scales.codes.slice(3 * i, 3 * i + 3), 255]),
    'quats.webp': quats(cloud),
    'sh0.webp': plane(count, (i) => [...colors.codes.slice(3 * i, 3 * i + 3), Math.round(255 * cloud.opacities[i])]),
  };
  const meta: Record<string, unknown> = {
    version: 2,
    count,
    means: { mins, maxs, files: ['means_l.webp', 'means_u.webp'] },
    scales: { codebook: scales.codebook, files: ['scales.webp'] },
    quats: { files: ['quats.webp'] },
    sh0: { codebook: colors.codebook, files: ['sh0.webp'] },
  };
  if (shDegree > 0) {
    const rest = quantize(
      Array.from({ length: count * 3 * coefficients }, (_, k) => {
        const i = Math.floor(k / (3 * coefficients));
        return cloud.sh[stride * i + 3 + (k % (3 * coefficients))];
      }),
    );
    const rows = Math.ceil(count / 64);
    const palette = new Uint8Array(4 * 64 * coefficients * rows);
    for (let k = 0; k < count * coefficients; k++) palette.set(rest.codes.slice(3 * k, 3 * k + 3), 4 * k);
    files['shN_centroids.webp'] = writeWebp(palette, 64 * coefficients, rows);
    files['shN_labels.webp'] = plane(count, (i) => [i & 255, i >> 8, 0, 255]);
    const names = ['shN_centroids.webp', 'shN_labels.webp'];
    meta.shN = { count, bands: shDegree, codebook: rest.codebook, files: names };
  }
  return { 'meta.json': new TextEncoder().encode(JSON.stringify(meta)), ...files };
}

/** SOG version 1, of degree 0: bytes between bounds, opacities as logits. */
export function writeSogV1(cloud: GaussianCloud): SogFiles {
  const { count, sh, shDegree } = cloud;
  const stride = 3 * (shDegree + 1) ** 2;
  const { mins, maxs, low, high } = means(cloud);
  const between = (channels: number, value: (i: number, k: number) => number) => {
    const bounds = Array.from({ length: channels }, (_, k) =>
      range(Array.from({ length: count }, (__, i) => value(i, k))),
    );
    const code = (i: number, k: number): number =>
      Math.round((255 * (value(i, k) - bounds[k][0])) / (bounds[k][1] - bounds[k][0] || 1));
    return { mins: bounds.map(([min]) => min), maxs: bounds.map(([, max]) => max), code };
  };
  const scales = between(3, (i, k) => Math.log(cloud.scales[3 * i + k]));
  const logit = (p: number): number => Math.log(p / (1 - p));
  const clamped = (p: number): number => Math.min(0.999, Math.max(0.001, p));
  const sh0 = between(4, (i, k) => (k < 3 ? sh[stride * i + k] : logit(clamped(cloud.opacities[i]))));
  const meta = {
    means: { shape: [count, 3], mins, maxs, files: ['means_l.webp', 'means_u.webp'] },
    scales: { mins: scales.mins, maxs: scales.maxs, files: ['scales.webp'] },
    quats: { encoding: 'quaternion_packed', files: ['quats.webp'] },
    sh0: { mins: sh0.mins, maxs: sh0.maxs, files: ['sh0.webp'] },
  };
  return {
    'meta.json': new TextEncoder().encode(JSON.stringify(meta)),
    'means_l.webp': low,
    'means_u.webp': high,
    'scales.webp': plane(count, (i) => [0, 1, 2].map((k) => scales.code(i, k)).concat(255)),
    'quats.webp': quats(cloud),
    'sh0.webp': plane(count, (i) => [0, 1, 2, 3].map((k) => sh0.code(i, k))),
  };
}
