/** Scenes of many millions of splats with few in view, packed by hand: no cloud of that size has to be built. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../../support/clouds.js';
import { seededRandom } from '../../support/random.js';

/** Splats of a chunk. */
const CHUNK = 256;
/** Positions of the splats outside the view. */
const BEHIND = [0, 0, -100] as const;

/** The part of the scene that is in view, as a small cloud. */
export function visiblePart(count: number): GaussianCloud {
  const random = seededRandom(11);
  return cloudOf(
    repeat(count, () => ({
      position: [random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5)],
      scale: random.uniform(0.01, 0.03),
      opacity: random.uniform(0.2, 0.9),
      color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    })),
  );
}

/** The visible part spread evenly over `count` splats; the others lie behind the camera. */
export function spreadOver(visible: GaussianCloud, count: number): PackedGaussians {
  const packed = packGaussians(visible);
  const [width, shWidth] = [packed.geometry.length / packed.count, packed.sh.length / packed.count];
  const geometry = new Uint32Array(width * count);
  const sh = new Uint32Array(shWidth * count);
  const hidden = packed.geometry.slice(0, width);
  new Float32Array(hidden.buffer).set(BEHIND);
  geometry.set(hidden);
  // Copying the written part repeatedly is the fastest way to fill gigabytes.
  for (let filled = width; filled < geometry.length; filled *= 2) {
    geometry.copyWithin(filled, 0, Math.min(filled, geometry.length - filled));
  }
  const step = Math.floor(count / packed.count);
  for (let i = 0; i < packed.count; i++) {
    geometry.set(packed.geometry.subarray(width * i, width * (i + 1)), width * i * step);
    sh.set(packed.sh.subarray(shWidth * i, shWidth * (i + 1)), shWidth * i * step);
  }
  const bounds = [-1, -1, -101, 1, 1, 1, 1, 0];
  const chunks = Float32Array.from({ length: 8 * Math.ceil(count / CHUNK) }, (_, i) => bounds[i % 8]);
  return { ...packed, count, geometry, sh, chunks };
}
