import type { GaussianCloud } from '@gaussian-splat/core';
import { allocateCloud } from '../cloud.js';
import { parseKsplatHeader } from '../ksplat/header.js';
import { unpackSection } from '../ksplat/unpack.js';
import type { SceneSource } from '../scene-format.js';

/**
 * Reads mkkellogg's `.ksplat`, the SplatBuffer of GaussianSplats3D (`src/loaders/SplatBuffer.js`): sections of splats, at level
 * 0 in float32, at 1 and 2 with 16-bit positions within buckets and float16, at 2 with coefficients in bytes. Sections
 * of a lower degree than the highest get zeros.
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
