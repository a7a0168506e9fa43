import { inverse, linearDeterminant, multiply, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import type { ModifierCut } from '../generated/modified-layouts.js';
import type { StructValues } from '../gpu/struct.js';
import { opticalFactor } from '../block-table.js';
import { UNCHANGED, type ColorMap } from './color-maps.js';

export const CUT_SHAPES = ['box', 'sphere', 'cylinder', 'plane', 'everywhere'] as const;

/**
 * Shape of a cut. `box`: a unit cube about the origin. `sphere` and `cylinder` (axis y): diameter and height 1, about
 * the origin. `plane`: the half-space below y = 0. `everywhere`: the whole space.
 */
export type CutShape = (typeof CUT_SHAPES)[number];

/**
 * Changes splats in a region of space. A splat at the edge of the region changes by the fraction of it that is inside.
 * A partly hidden splat is trimmed: it becomes the Gaussian with the mass, mean and variance of its visible part.
 */
export interface SplatCut {
  readonly shape: CutShape;
  /** Matrix from shape coordinates to world coordinates: row-major 4x4, last row (0, 0, 0, 1). */
  readonly shapeToWorld: Matrix4;
  /**
   * Groups to which the inside of the cut is limited: indices of {@link SplatGroupIds}. Default: no limit. Scenes without
   * groups ignore a cut with groups.
   */
  readonly groups?: readonly number[] | undefined;
  /** Side of the surface on which splats change. Default: `inside`. */
  readonly side?: 'inside' | 'outside' | undefined;
  /**
   * Standard deviation of the edge in world units, in addition to that of each splat. With `hard` the centers of splats
   * decide. Default: 0.
   */
  readonly edge?: number | 'hard' | undefined;
  /** Factor of the opacity of splats, 0 to 1; 0 hides them. Default: 1. */
  readonly opacity?: number | undefined;
  /** Opacity, 0 to 1, that an otherwise opaque surface gets: see `Placement.opacity`. Default: 1. */
  readonly surfaceOpacity?: number | undefined;
  /** Map of the colors of splats. Default: no change. */
  readonly color?: ColorMap | undefined;
  /** Displacement in world units. Default: none. */
  readonly offset?: Vector3 | undefined;
}

/**
 * Value of each shape in the shaders. Constants are accessed by literal names, because a computed access would keep all
 * constants in the bundle.
 */
const NUMBERS: Readonly<Record<CutShape, number>> = {
  box: constants.CUT_BOX,
  sphere: constants.CUT_SPHERE,
  cylinder: constants.CUT_CYLINDER,
  plane: constants.CUT_PLANE,
  everywhere: constants.CUT_EVERYWHERE,
};

/** Row of the matrix to a shape without volume. It places all points outside the shape. */
const NOWHERE = [0, 0, 0, 1e6];

/**
 * Converts a cut to the layout of the shaders.
 * @param toWorld Matrix from the coordinates of blocks to world coordinates.
 * @param toLocal Inverse of `toWorld`.
 */
export function cutValues(cut: SplatCut, toWorld: Matrix4, toLocal: Matrix4): StructValues<typeof ModifierCut> {
  const { shape, side, edge = 0, opacity = 1, surfaceOpacity = 1, color = UNCHANGED, offset = [0, 0, 0] } = cut;
  const toShape = multiply(inverse(cut.shapeToWorld), toWorld);
  const isSolid = toShape.every(Number.isFinite);
  const row = (k: number): ArrayLike<number> => (isSolid ? toShape.subarray(4 * k, 4 * k + 4) : NOWHERE);
  return {
    ...{ to_shape_x: row(0), to_shape_y: row(1), to_shape_z: row(2) },
    ...{ red: color.slice(0, 4), green: color.slice(4, 8), blue: color.slice(8, 12) },
    offset: directionIn(toLocal, offset),
    shape: NUMBERS[shape],
    opacity,
    thinned: opticalFactor(surfaceOpacity),
    edge: edge === 'hard' ? -1 : edge * sizeOf(toLocal),
    is_outside: side === 'outside' ? 1 : 0,
    has_color: color === UNCHANGED ? 0 : 1,
    ...{ reserved_a: 0, reserved_b: 0, reserved_c: 0 },
  };
}

/** Transforms a direction by the linear part of a matrix. */
export const directionIn = (m: Matrix4, [x, y, z]: Vector3): Vector3 => [
  m[0] * x + m[1] * y + m[2] * z,
  m[4] * x + m[5] * y + m[6] * z,
  m[8] * x + m[9] * y + m[10] * z,
];

/** Returns the mean scale factor of a matrix: the cube root of its factor of volumes. */
const sizeOf = (m: Matrix4): number => Math.cbrt(Math.abs(linearDeterminant(m)));
