import { halfToNumber, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { viewOf } from '../bytes.js';
import { allocateCloud, SH_C0, type DraftCloud } from '../cloud.js';
import { parseKsplatHeader, type KsplatHeader, type KsplatSection } from '../ksplat/header.js';
import type { SceneSource } from '../scene-format.js';

/**
 * Number of coefficients of a channel in each band above the constant one. In a file, each band has those of red, then
 * green, then blue.
 */
const BANDS = [3, 5, 7];

/**
 * Reads mkkellogg's `.ksplat`, the SplatBuffer of GaussianSplats3D (`src/loaders/SplatBuffer.js`). Values are float32 in
 * level 0. Levels 1 and 2 have float16, with 16-bit positions within buckets; coefficients are bytes in level 2.
 * Coefficients are padded with zeros if a section has a lower degree than others.
 */
export function readKsplat(source: SceneSource): GaussianCloud {
  const { bytes, name, signal, isPrefix = false } = source;
  const header = parseKsplatHeader(bytes, name, isPrefix);
  const cloud = allocateCloud(header.count, header.degree, source);
  let first = 0;
  for (const section of header.sections) {
    signal?.throwIfAborted();
    unpackSection(bytes, header, section, cloud, first);
    first += section.count;
  }
  return cloud;
}

type ReadNumber = (at: number) => number;

/** Writes the splats of a section to a cloud, from index `first` on. */
function unpackSection(
  bytes: Uint8Array,
  header: KsplatHeader,
  section: KsplatSection,
  cloud: DraftCloud,
  first: number,
): void {
  const view = viewOf(bytes);
  const isWide = header.level === 0;
  const number: ReadNumber = isWide
    ? (at) => view.getFloat32(at, true)
    : (at) => halfToNumber(view.getUint16(at, true));
  const size = isWide ? 4 : 2;
  const centers = isWide ? undefined : centersOf(view, section);
  const { positionStep, positionRange } = section;
  for (let k = 0; k < section.count; k++) {
    const from = section.splatsAt + k * section.bytesPerSplat;
    const to = first + k;
    for (let axis = 0; axis < 3; axis++) {
      cloud.positions[3 * to + axis] = centers
        ? (view.getUint16(from + 2 * axis, true) - positionRange) * positionStep + centers[3 * k + axis]
        : number(from + 4 * axis);
      cloud.scales[3 * to + axis] = number(from + size * (3 + axis));
    }
    for (let c = 0; c < 4; c++) cloud.rotations[4 * to + c] = number(from + size * (6 + c));
    unpackColor(bytes, from + 10 * size, cloud, to);
  }
  unpackHarmonics(view, header, section, cloud, first);
}

function unpackColor(bytes: Uint8Array, at: number, { sh, shDegree, opacities }: DraftCloud, to: number): void {
  const stride = 3 * shCoefficientCount(shDegree);
  for (let channel = 0; channel < 3; channel++) sh[stride * to + channel] = (bytes[at + channel] / 255 - 0.5) / SH_C0;
  opacities[to] = bytes[at + 3] / 255;
}

/** Returns the center of each splat's bucket, [count, 3]. Full buckets come first, then partial ones with stored sizes. */
function centersOf(view: DataView, section: KsplatSection): Float32Array {
  const { count, bucketSize, fullBuckets, partialBuckets, bucketsAt, bucketStride, partialSizesAt } = section;
  const centers = new Float32Array(3 * count);
  let splat = 0;
  for (let bucket = 0; bucket < fullBuckets + partialBuckets && splat < count; bucket++) {
    const isFull = bucket < fullBuckets;
    const size = isFull ? bucketSize : view.getUint32(partialSizesAt + 4 * (bucket - fullBuckets), true);
    const at = bucketsAt + bucketStride * bucket;
    const center = [view.getFloat32(at, true), view.getFloat32(at + 4, true), view.getFloat32(at + 8, true)];
    for (const end = Math.min(count, splat + size); splat < end; splat++) centers.set(center, 3 * splat);
  }
  return centers;
}

function unpackHarmonics(
  view: DataView,
  header: KsplatHeader,
  section: KsplatSection,
  { sh, shDegree }: DraftCloud,
  first: number,
): void {
  const stride = 3 * shCoefficientCount(shDegree);
  const [low, high] = header.coefficientRange;
  const size = [4, 2, 1][header.level];
  const read: ReadNumber = [
    (at: number) => view.getFloat32(at, true),
    (at: number) => halfToNumber(view.getUint16(at, true)),
    (at: number) => low + (view.getUint8(at) / 255) * (high - low),
  ][header.level];
  const offset = (header.level === 0 ? 40 : 20) + 4;
  for (let k = 0; k < section.count; k++) {
    let from = section.splatsAt + k * section.bytesPerSplat + offset;
    let to = (first + k) * stride + 3;
    for (let band = 0; band < section.degree; band++) {
      const coefficients = BANDS[band];
      for (let channel = 0; channel < 3; channel++) {
        for (let c = 0; c < coefficients; c++, from += size) sh[to + 3 * c + channel] = read(from);
      }
      to += 3 * coefficients;
    }
  }
}
