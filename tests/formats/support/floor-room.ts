/** A room of boxes as splats, whose walkable space is known exactly, and a random walk through it. */
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { floorAt, stepOn, type FloorMap, type FloorOptions } from '@gaussian-splat/formats/floor';
import { isLab } from '../../support/extent.js';

/** Splats on surfaces of boxes, y down as trainers write them, meters; walkable space is known exactly. */
interface Box {
  readonly min: Vector3;
  readonly max: Vector3;
}

const SPACING = 0.06;
export const FRAME: FloorOptions['frame'] = [
  [1, 0, 0],
  [0, -1, 0],
  [0, 0, -1],
];

export function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/** The six sides of boxes as flat splats, 6 cm apart. `spoil` moves, fades and scatters some of them. */
export function cloudOf(boxes: readonly Box[], spoil?: () => number): GaussianCloud {
  const centers: number[] = [];
  const scales: number[] = [];
  const opacities: number[] = [];
  const add = (at: number[], scale: number[], opacity: number): void => {
    const shift = spoil ? () => 0.03 * (spoil() - 0.5) : () => 0;
    centers.push(at[0] + shift(), -(at[1] + shift()), -(at[2] + shift()));
    scales.push(...scale);
    opacities.push(opacity);
  };
  for (const { min, max } of boxes)
    for (const axis of [0, 1, 2])
      for (const side of [min, max]) {
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        for (let a = min[u]; a <= max[u]; a += SPACING)
          for (let b = min[v]; b <= max[v]; b += SPACING) {
            const at = [0, 0, 0];
            [at[axis], at[u], at[v]] = [side[axis], a, b];
            const scale = [SPACING, SPACING, SPACING];
            scale[axis] = 0.004;
            add(at, scale, spoil ? 0.3 + 0.7 * spoil() : 0.95);
          }
      }
  if (spoil)
    for (let i = 0; i < 400; i++)
      add([8 * spoil() - 4, 0.2 + 2 * spoil(), 8 * spoil() - 4], [0.03, 0.03, 0.03], 0.2 + 0.7 * spoil());
  const count = opacities.length;
  const rotations = new Float32Array(4 * count);
  for (let i = 0; i < count; i++) rotations[4 * i] = 1;
  return {
    count,
    origin: [0, 0, 0],
    positions: Float32Array.from(centers),
    scales: Float32Array.from(scales),
    rotations,
    opacities: Float32Array.from(opacities),
    sh: new Float32Array(3 * count),
    shDegree: 0,
    antialiased: false,
    droppedCount: 0,
  };
}

/** A room of 8 by 8 m with a wall that has a door, a table, and stairs of 20 cm to a gallery that one can also walk under. */
export const ROOM: readonly Box[] = [
  { min: [-4, -0.2, -4], max: [4, 0, 4] },
  { min: [-4.2, 0, -4], max: [-4, 3, 4] },
  { min: [4, 0, -4], max: [4.2, 3, 4] },
  { min: [-4, 0, -4.2], max: [4, 3, -4] },
  { min: [-4, 0, 4], max: [4, 3, 4.2] },
  { min: [-4, 0, 0], max: [1, 2.6, 0.2] },
  { min: [2.4, 0, 0], max: [4, 2.6, 0.2] },
  { min: [-1, 0.7, -3], max: [1, 0.8, -2] },
  ...Array.from({ length: 11 }, (_, i): Box => ({
    min: [2.4, 0, -0.4 - 0.3 * (i + 1)],
    max: [3.8, 0.2 * (i + 1), -0.4 - 0.3 * i],
  })),
  { min: [-4, 2.1, -4], max: [4, 2.2, -3.4] },
];

/** Whether a body of radius 10 cm at a place on the ground floor would be in a wall, or over the table. */
export function isOutside([x, y, z]: readonly [number, number, number]): boolean {
  const touches = ({ min, max }: Box): boolean =>
    x > min[0] - 0.1 &&
    x < max[0] + 0.1 &&
    z > min[2] - 0.1 &&
    z < max[2] + 0.1 &&
    max[1] > y + 0.35 &&
    min[1] < y + 1.5;
  return ROOM.some(touches);
}

/** Ten minutes of a random walk at 1.4 m/s, 72 steps a second; a tenth of it in `npm test`. */
const STEPS = isLab ? 43_200 : 4_320;

export function wander(
  map: FloorMap,
  isWrong: (at: readonly [number, number, number]) => boolean,
): { out: number; levels: Set<number> } {
  const next = random(7);
  const levels = new Set<number>();
  let at = map.start;
  let out = 0;
  for (let i = 0, heading = 0; i < STEPS; i++) {
    heading += (next() - 0.5) * 0.2;
    const to = stepOn(map, at, (Math.sin(heading) * 1.4) / 72, (Math.cos(heading) * 1.4) / 72);
    if (to === at) heading = 2 * Math.PI * next();
    at = to;
    if (floorAt(map, at[0], at[2], at[1]) === undefined || isWrong(at)) out++;
    levels.add(Math.round(at[1]));
  }
  return { out, levels };
}
