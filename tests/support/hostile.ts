/** Clouds with splats in them that no renderer may draw. */
import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';

export interface HostileCloud {
  /** Good and bad splats mixed; not passed through `keepUsable`. */
  readonly cloud: GaussianCloud;
  /** Indices of the original's splats in it, in their order. */
  readonly good: Uint32Array;
  /** Index and fault of each bad splat. */
  readonly bad: readonly { readonly index: number; readonly fault: string }[];
}

type Attribute = 'positions' | 'scales' | 'rotations' | 'opacities' | 'sh';

/** One way to spoil a splat: writes `values` into `attribute`, from component `first` on. */
interface Fault {
  readonly name: string;
  readonly attribute: Attribute;
  readonly first: number;
  readonly values: readonly number[];
}

/**
 * The cloud with bad splats mixed in: each a copy of a good one, so that it would be seen if it were drawn, with one fault:
 * NaN or an infinity in any single component of any attribute, a zero quaternion, scales of 1e-30, 1e30 or infinity on
 * all axes, a negative scale. Every fault occurs at least once, at the very start and the very end among other places.
 */
export function withHostileSplats(original: GaussianCloud): HostileCloud {
  const faults = faultsOf(original);
  // Spread so that bad ones stand between good ones, never fewer than there are kinds of faults.
  const badCount = Math.max(faults.length, Math.floor(original.count / 3));
  const total = original.count + badCount;
  const cloud = emptyLike(original, total);
  const good: number[] = [];
  const bad: { index: number; fault: string }[] = [];
  for (let index = 0; index < total; index++) {
    const source = Math.min(good.length, original.count - 1);
    copySplat(original, source, cloud, index);
    // Bresenham's line: bad splats are evenly spaced; the first and the last place are bad.
    if (bad.length * (total - 1) <= index * (badCount - 1)) {
      const fault = faults[bad.length % faults.length];
      cloud[fault.attribute].set(fault.values, sizeOf(original)[fault.attribute] * index + fault.first);
      bad.push({ index, fault: fault.name });
    } else {
      good.push(index);
    }
  }
  return { cloud, good: Uint32Array.from(good), bad };
}

function faultsOf(cloud: GaussianCloud): Fault[] {
  const faults: Fault[] = [
    { name: 'rotation 0', attribute: 'rotations', first: 0, values: [0, 0, 0, 0] },
    { name: 'scale 1e-30', attribute: 'scales', first: 0, values: [1e-30, 1e-30, 1e-30] },
    { name: 'scale 1e30', attribute: 'scales', first: 0, values: [1e30, 1e30, 1e30] },
    { name: 'scale Infinity', attribute: 'scales', first: 0, values: [Infinity, Infinity, Infinity] },
    { name: 'position 1e37', attribute: 'positions', first: 0, values: [1e37] },
    { name: 'position -2e18', attribute: 'positions', first: 2, values: [-2e18] },
    { name: 'scale -1', attribute: 'scales', first: 1, values: [-1] },
  ];
  for (const [attribute, size] of Object.entries(sizeOf(cloud)) as [Attribute, number][]) {
    for (let first = 0; first < size; first++) {
      for (const value of [NaN, Infinity, -Infinity]) {
        faults.push({ name: `${attribute}[${first}] = ${value}`, attribute, first, values: [value] });
      }
    }
  }
  return faults;
}

/** Numbers to a splat in each array. */
const sizeOf = (cloud: GaussianCloud): Record<Attribute, number> => ({
  positions: 3,
  scales: 3,
  rotations: 4,
  opacities: 1,
  sh: 3 * shCoefficientCount(cloud.shDegree),
});

function emptyLike(cloud: GaussianCloud, count: number): GaussianCloud {
  const size = sizeOf(cloud);
  return {
    ...cloud,
    count,
    positions: new Float32Array(size.positions * count),
    scales: new Float32Array(size.scales * count),
    rotations: new Float32Array(size.rotations * count),
    opacities: new Float32Array(size.opacities * count),
    sh: new Float32Array(size.sh * count),
  };
}

function copySplat(from: GaussianCloud, i: number, to: GaussianCloud, at: number): void {
  for (const [attribute, size] of Object.entries(sizeOf(from)) as [Attribute, number][]) {
    to[attribute].set(from[attribute].subarray(size * i, size * (i + 1)), size * at);
  }
}
