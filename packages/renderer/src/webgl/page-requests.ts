/** Requests pages on the CPU, as `page_feedback.wgsl` does. */
import type { Camera, Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from '../levels/chunk-detail.js';
import { SLOT_CHUNKS } from '../streaming/manifest.js';
import { NONE, type PageList } from '../streaming/page-list.js';
import type { Residency } from '../streaming/residency.js';
import { levelChoice, pixelsOf } from './level-choice.js';

const { NEARBY, NEARBY_SIZE, SOON, UNSEEN } = constants;
const { sphere, error, fullError } = DETAIL_PLACES;

/** The pages of a scene, those that are resident, and [C, 12] the levels of all chunks of slots. */
export interface ResidentPages {
  readonly list: PageList;
  readonly slots: Residency['slots'];
  readonly details: Float32Array;
  /** World position of the origin of the splat positions. */
  readonly origin: Vector3;
}

/**
 * Returns the error in pixels of each missing page, the largest of all views, and at index 0 the largest in the first
 * view.
 * @param allowed Maximum error, pixels.
 */
export function pageRequests(
  { list, slots, details, origin }: ResidentPages,
  cameras: readonly Camera[],
  allowed: number,
): Float32Array {
  const requests = new Float32Array(list.count);
  const views = cameras.map((camera) => ({
    choice: levelChoice(camera, origin, allowed),
    sees: sightOf(camera, origin),
  }));
  // Without iterators: the main thread reads tens of thousands of chunks.
  for (const page of slots.pages()) {
    const own = slots.of(page);
    for (let k = 0, children = list.firstChunk[page]; k < own.length; k++, children += SLOT_CHUNKS) {
      const chunks = Math.min(SLOT_CHUNKS, list.chunks[page] - SLOT_CHUNKS * k);
      for (let chunk = 0; chunk < chunks; chunk++) {
        const child = list.children[children + chunk];
        if (child === NONE) continue;
        const at = DETAIL_NUMBERS * (SLOT_CHUNKS * own[k] + chunk);
        for (let n = 0; n < views.length; n++) {
          const { choice, sees } = views[n];
          const pixels = pixelsOf(details, at + sphere, details[at + fullError], choice);
          if (pixels <= SOON * allowed) continue;
          const needed = pixels * sees(details, at + sphere);
          if (needed > requests[child]) requests[child] = needed;
          const isMissing = n === 0 && details[at + error] === 0 && pixels > allowed;
          if (isMissing && needed > requests[0]) requests[0] = needed;
        }
      }
    }
  }
  return requests;
}

/** Middle and half of the image along an axis at depth 1, and the reach of a sphere of radius 1 beyond its edge. */
interface Side {
  readonly middle: number;
  readonly half: number;
  readonly wide: number;
}

const reaches = ({ middle, half, wide }: Side, place: number, scale: number, radius: number): boolean =>
  Math.abs(place - middle * scale) <= half * scale + radius * wide;

/** Returns a function that weights a sphere by its place: 1 in the image, less beside it. */
function sightOf(camera: Camera, origin: Vector3): (numbers: Float32Array, at: number) => number {
  const { worldToCamera: m, near, fx, fy, cx, cy, width, height, orthographic = false } = camera;
  const offsetOf = (row: number): number =>
    m[row] * origin[0] + m[row + 1] * origin[1] + m[row + 2] * origin[2] + m[row + 3];
  const [right, below, ahead] = [offsetOf(0), offsetOf(4), offsetOf(8)];
  const size = Math.hypot(m[8], m[9], m[10]);
  const sideOf = (middle: number, half: number): Side => ({
    middle,
    half,
    wide: orthographic ? 1 : Math.hypot(1, Math.abs(middle) + half),
  });
  const sidesOf = (factor: number): readonly [across: Side, down: Side] => [
    sideOf((width / 2 - cx) / fx, (factor * width) / (2 * fx)),
    sideOf((height / 2 - cy) / fy, (factor * height) / (2 * fy)),
  ];
  const [image, nearby] = [sidesOf(1), sidesOf(NEARBY_SIZE)];
  return (numbers, at) => {
    const x = numbers[at];
    const y = numbers[at + 1];
    const z = numbers[at + 2];
    const depth = m[8] * x + m[9] * y + m[10] * z + ahead;
    const radius = numbers[at + 3] * size;
    if (depth + radius < near) return UNSEEN;
    const across = m[0] * x + m[1] * y + m[2] * z + right;
    const down = m[4] * x + m[5] * y + m[6] * z + below;
    const scale = orthographic ? 1 : Math.max(0, depth);
    if (reaches(image[0], across, scale, radius) && reaches(image[1], down, scale, radius)) return 1;
    return reaches(nearby[0], across, scale, radius) && reaches(nearby[1], down, scale, radius) ? NEARBY : UNSEEN;
  };
}
