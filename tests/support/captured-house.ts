/** A house whose floor is known, as splats of ever worse captures: noise, faint and missing splats, floaters, haze, ghosts, a background. */
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';

/** Seeded generator of uniform and normal numbers. */
class Random {
  #state: number;

  constructor(seed: number) {
    this.#state = seed;
  }

  uniform(low = 0, high = 1): number {
    this.#state = (Math.imul(this.#state, 1664525) + 1013904223) >>> 0;
    return low + ((high - low) * this.#state) / 2 ** 32;
  }

  normal(): number {
    return Math.sqrt(-2 * Math.log(this.uniform() || 1e-9)) * Math.cos(2 * Math.PI * this.uniform());
  }
}

/** A rectangle parallel to two axes, meters with y up; `keep` leaves out openings. */
interface Rectangle {
  readonly min: Vector3;
  readonly max: Vector3;
  readonly keep?: (at: Vector3) => boolean;
}

const STAIRS = { count: 14, rise: 0.18, run: 0.27, x: 3.9, z: 1.3 } as const;
/** Height of the gallery and its first x, meters. */
const [GALLERY, EDGE] = [STAIRS.count * STAIRS.rise, STAIRS.x + STAIRS.count * STAIRS.run];
const HOLE = { x: -1.8, z: 1.4, radius: 0.5 } as const;

const side = (min: Vector3, max: Vector3, keep?: Rectangle['keep']): Rectangle => ({ min, max, keep });
function boxSides([x0, y0, z0]: Vector3, [x1, y1, z1]: Vector3): Rectangle[] {
  return [
    side([x0, y0, z0], [x1, y1, z0]),
    side([x0, y0, z1], [x1, y1, z1]),
    side([x0, y0, z0], [x0, y1, z1]),
    side([x1, y0, z0], [x1, y1, z1]),
    side([x0, y1, z0], [x1, y1, z1]),
  ];
}

export interface HouseOptions {
  readonly hasGarden?: boolean;
  /** Whether a box of 25 cm and a chair of 50 cm lead to the table of 75 cm. */
  readonly hasChain?: boolean;
}

/** Boxes that stand in the house, meters. */
const furniture = (hasChain: boolean): (readonly [Vector3, Vector3])[] => [
  [[-0.6, 0.71, -0.4], [0.6, 0.75, 0.4]],
  [[-3, 0, -2.4], [-2.2, 0.42, -0.6]],
  ...(hasChain ? ([[[0.6, 0, -0.4], [1, 0.5, 0.4]], [[1, 0, -0.4], [1.4, 0.25, 0.4]]] as const) : []),
]; // prettier-ignore

/** Two rooms of 6 m with a door, a window, a table, a sofa, a hole of 1 m in the floor, and stairs to a gallery. */
function house({ hasGarden = false, hasChain = false }: HouseOptions): Rectangle[] {
  const isDoor = ([, y, z]: Vector3): boolean => Math.abs(z) < 0.45 && y < 2;
  const isHole = ([x, , z]: Vector3): boolean => Math.hypot(x - HOLE.x, z - HOLE.z) < HOLE.radius;
  const isWindow = ([x, y]: Vector3): boolean => Math.abs(x) < 1 && y > 0.9 && y < 2;
  const wall = (x0: number, z0: number, x1: number, z1: number, height: number, keep?: Rectangle['keep']): Rectangle =>
    side([x0, 0, z0], [x1, height, z1], keep);
  return [
    side([-3, 0, -2.5], [3.1, 0, 2.5], (at) => !isHole(at)),
    side([3.1, 0, -2.5], [9, 0, 2.5]),
    ...boxSides([-2.3, -1.2, 0.9], [-1.3, -0.02, 1.9]).slice(0, 4),
    side([-2.3, -1.2, 0.9], [-1.3, -1.2, 1.9]),
    ...[wall(-3, -2.5, 3, -2.5, 2.6, (at) => !isWindow(at)), wall(-3, 2.5, 3, 2.5, 2.6), wall(-3, -2.5, -3, 2.5, 2.6)],
    ...[wall(3, -2.5, 3, 2.5, 2.6, (at) => !isDoor(at)), wall(3.1, -2.5, 3.1, 2.5, 5.2, (at) => !isDoor(at))],
    ...[wall(3, -0.45, 3.1, -0.45, 2), wall(3, 0.45, 3.1, 0.45, 2), side([3, 2, -0.45], [3.1, 2, 0.45])],
    ...[wall(3.1, -2.5, 9, -2.5, 5.2), wall(3.1, 2.5, 9, 2.5, 5.2), wall(9, -2.5, 9, 2.5, 5.2)],
    ...[side([-3, 2.6, -2.5], [3, 2.6, 2.5]), side([3.1, 5.2, -2.5], [9, 5.2, 2.5])],
    ...Array.from({ length: STAIRS.count }, (_, i) => {
      const [x, y] = [STAIRS.x + i * STAIRS.run, (i + 1) * STAIRS.rise];
      return [
        side([x, y, STAIRS.z], [x + STAIRS.run, y, 2.5]),
        side([x, y - STAIRS.rise, STAIRS.z], [x, y, 2.5]),
        side([x, 0, STAIRS.z], [x + STAIRS.run, y, STAIRS.z]),
      ];
    }).flat(),
    ...[side([EDGE, GALLERY, -2.5], [9, GALLERY, 2.5]), side([EDGE, GALLERY - 0.15, -2.5], [9, GALLERY - 0.15, 2.5])],
    ...[side([EDGE, GALLERY - 0.15, -2.5], [EDGE, GALLERY + 1, STAIRS.z])],
    ...furniture(hasChain).flatMap(([min, max]) => boxSides(min, max)),
    ...(hasGarden
      ? [side([-9, -0.1, -9], [9, -0.1, -2.6]), side([-9, -0.1, 2.6], [9, -0.1, 9]), side([-9, -0.1, -2.6], [-3.1, -0.1, 2.6])]
      : []),
  ]; // prettier-ignore
}

export interface CaptureOptions extends HouseOptions {
  /** Standard deviation of the distance of splats from their surface, meters. */
  readonly noise?: number;
  /** Lowest opacity; the highest is 1. */
  readonly faintest?: number;
  /** Fraction of the splats that are missing. */
  readonly missing?: number;
  /** Numbers of floaters of 1 to 12 cm, and of distant splats, relative to the splats of the house. */
  readonly floaters?: number;
  readonly far?: number;
  /** Number of splats of 30 to 90 cm with opacities of 1 to 5 %. */
  readonly haze?: number;
  /** Fraction of the splats that are mirrored below the floor. */
  readonly ghosts?: number;
  /** Rotation of the axes of the file about z, radians. */
  readonly tilt?: number;
}

const SPACING = 0.035;

/** Returns the splats of a house with y up, meters, captured well or badly. */
export function capturedHouse(options: CaptureOptions): GaussianCloud {
  const { noise = 0, faintest = 0.95, missing = 0, floaters = 0, far = 0, haze = 0, ghosts = 0, tilt = 0 } = options;
  const random = new Random(1);
  const [positions, scales, opacities, rotations]: number[][] = [[], [], [], []];
  const add = (at: readonly number[], scale: readonly number[], opacity: number, isTurned = false): void => {
    positions.push(...at);
    scales.push(...scale);
    opacities.push(Math.min(0.999, opacity));
    const turn = isTurned ? [0, 0, 0, 0].map(() => random.normal()) : [1, 0, 0, 0];
    const length = Math.hypot(...turn);
    rotations.push(...turn.map((value) => value / length));
  };
  for (const { min, max, keep } of house(options)) {
    const flat = min.findIndex((value, k) => value === max[k]);
    const [u, v] = [(flat + 1) % 3, (flat + 2) % 3];
    const counts = [u, v].map((axis) => Math.max(1, Math.round((max[axis] - min[axis]) / SPACING)));
    for (let i = 0; i < counts[0]; i++)
      for (let j = 0; j < counts[1]; j++) {
        const at = [...min] as [number, number, number];
        at[u] += ((i + 0.35 + 0.3 * random.uniform()) * (max[u] - min[u])) / counts[0];
        at[v] += ((j + 0.35 + 0.3 * random.uniform()) * (max[v] - min[v])) / counts[1];
        if (keep?.(at) === false || random.uniform() < missing) continue;
        at[flat] += noise * random.normal();
        const size = 0.7 * SPACING * (noise > 0 ? Math.exp(0.5 * random.normal()) : 1);
        const scale = [size, size, size];
        scale[flat] = noise > 0 ? 0.012 : 0.004;
        const opacity = random.uniform(faintest, 1);
        add(at, scale, opacity);
        if (at[1] > 0.05 && random.uniform() < ghosts) add([at[0], -at[1], at[2]], scale, 0.4 * opacity);
      }
  }
  const count = opacities.length;
  const inRoom = (): number[] => [random.uniform(-3, 9), random.uniform(0.1, 2.5), random.uniform(-2.5, 2.5)];
  const between = (low: number, high: number): number[] => [0, 0, 0].map(() => random.uniform(low, high));
  for (let i = 0; i < floaters * count; i++) add(inRoom(), between(0.01, 0.12), random.uniform(0.05, 0.9), true);
  for (let i = 0; i < haze; i++) add(inRoom(), between(0.3, 0.9), random.uniform(0.01, 0.05), true);
  for (let i = 0; i < far * count; i++) {
    const [angle, distance] = [random.uniform(0, 2 * Math.PI), 10 ** random.uniform(1.2, 2.4)];
    const height = 0.3 * distance * Math.abs(random.normal());
    const at = [distance * Math.cos(angle), height, distance * Math.sin(angle)];
    add(at, [0.03 * distance, 0.03 * distance, 0.03 * distance], random.uniform(0.3, 0.95), true);
  }
  const [cos, sin] = [Math.cos(tilt), Math.sin(tilt)];
  const [halfCos, halfSin] = [Math.cos(tilt / 2), Math.sin(tilt / 2)];
  for (let i = 0; i < opacities.length; i++) {
    const [x, y] = [positions[3 * i], positions[3 * i + 1]];
    [positions[3 * i], positions[3 * i + 1]] = [cos * x - sin * y, sin * x + cos * y];
    const [a, b, c, d] = rotations.slice(4 * i, 4 * i + 4);
    rotations.splice(4 * i, 4, halfCos * a - halfSin * d, halfCos * b - halfSin * c, halfCos * c + halfSin * b, halfCos * d + halfSin * a); // prettier-ignore
  }
  return {
    count: opacities.length,
    origin: [0, 0, 0],
    positions: Float32Array.from(positions),
    scales: Float32Array.from(scales),
    rotations: Float32Array.from(rotations),
    opacities: Float32Array.from(opacities),
    sh: new Float32Array(3 * opacities.length),
    shDegree: 0,
    antialiased: false,
    droppedCount: 0,
  };
}

/** Returns the height of a tread of the stairs; undefined beside the stairs. */
function treadAt(x: number, z: number): number | undefined {
  const i = Math.floor((x - STAIRS.x) / STAIRS.run);
  return z > STAIRS.z && z < 2.5 && i >= 0 && i < STAIRS.count ? (i + 1) * STAIRS.rise : undefined;
}

/** Returns the heights of the floors, treads and the gallery at a place in the house, meters; none at the hole. */
export function floorsOfHouse(x: number, z: number): readonly number[] {
  if (!(x > -3 && x < 9 && Math.abs(z) < 2.5)) return [];
  if ((x > 3 && x < 3.1 && Math.abs(z) > 0.45) || Math.hypot(x - HOLE.x, z - HOLE.z) < HOLE.radius) return [];
  const tread = treadAt(x, z);
  // A body fits under the upper treads, which are reached from below the gallery.
  return tread === undefined ? [0, ...(x > EDGE ? [GALLERY] : [])] : [tread, ...(tread > 1.7 ? [0] : [])];
}

/** Whether a body of `radius` meters that stands at a height of {@link floorsOfHouse} touches a wall, stairs or furniture. */
export function isBlockedInHouse([x, y, z]: Vector3, radius: number, hasChain = false): boolean {
  const touches = (min: Vector3, max: Vector3): boolean =>
    max[1] > y + 0.3 &&
    min[1] < y + 1.7 &&
    Math.hypot(x - Math.min(max[0], Math.max(min[0], x)), z - Math.min(max[2], Math.max(min[2], z))) < radius;
  const stairs = Array.from({ length: STAIRS.count }, (_, i): [Vector3, Vector3][] => {
    const [x, height] = [STAIRS.x + i * STAIRS.run, (i + 1) * STAIRS.rise];
    return [
      [[x, height - 0.02, STAIRS.z], [x + STAIRS.run, height, 2.5]],
      [[x, 0, STAIRS.z], [x + STAIRS.run, height, STAIRS.z + 0.01]],
    ]; // prettier-ignore
  }).flat();
  return [
    ...furniture(hasChain),
    ...stairs,
    ...[[[-3, 0, -2.6], [9, 6, -2.5]], [[-3, 0, 2.5], [9, 6, 2.6]], [[-3.1, 0, -2.5], [-3, 6, 2.5]], [[9, 0, -2.5], [9.1, 6, 2.5]]] as [Vector3, Vector3][], // prettier-ignore
    ...[[[3, 0, -2.5], [3.1, 6, -0.45]], [[3, 0, 0.45], [3.1, 6, 2.5]], [[EDGE, GALLERY - 0.15, -2.5], [EDGE + 0.01, GALLERY + 1, STAIRS.z]]] as [Vector3, Vector3][], // prettier-ignore
  ].some(([min, max]) => touches(min, max));
}
