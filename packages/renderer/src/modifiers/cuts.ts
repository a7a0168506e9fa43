import { inverse, multiply, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import type { ModifierCut } from '../generated/modified-layouts.js';
import type { StructValues } from '../gpu/struct.js';
import { opticalFactor } from '../page-table.js';
import { UNCHANGED, type ColorMap } from './color-maps.js';

export const CUT_SHAPES = ['box', 'sphere', 'cylinder', 'plane'] as const;

/** A unit cube, or a sphere or a cylinder (axis y) of diameter and height 1, about the origin; or all that lies below the plane y = 0. */
export type CutShape = (typeof CUT_SHAPES)[number];

/**
 * Changes splats in a region of space. A splat at its edge changes by the fraction that lies inside. A splat that is
 * hidden in part is trimmed: the rest becomes the Gaussian of its mass, mean and variance.
 */
export interface SplatCut {
  readonly shape: CutShape;
  /** Row-major 4x4, last row (0, 0, 0, 1): from shape coordinates to world coordinates. */
  readonly shapeToWorld: Matrix4;
  /** Side of the surface that changes. Default: `inside`. */
  readonly side?: 'inside' | 'outside' | undefined;
  /**
   * Standard deviation of the edge in world units, in addition to the splat's own; `hard` decides by the centers of
   * splats. Default: 0.
   */
  readonly edge?: number | 'hard' | undefined;
  /** Factor of the opacity, 0 to 1; 0 hides. Default: 1. */
  readonly opacity?: number | undefined;
  /** Opacity of an otherwise opaque surface, 0 to 1, same as `Placement.opacity`. Default: 1. */
  readonly surfaceOpacity?: number | undefined;
  /** Default: colors are unchanged. */
  readonly color?: ColorMap | undefined;
  /** Displacement in world units. Default: none. */
  readonly offset?: Vector3 | undefined;
}

/** Accessed by literal names, because a computed access would keep all constants in the bundle. */
const NUMBERS: Readonly<Record<CutShape, number>> = {
  box: constants.CUT_BOX,
  sphere: constants.CUT_SPHERE,
  cylinder: constants.CUT_CYLINDER,
  plane: constants.CUT_PLANE,
};

/** Map to a shape without volume: everything is outside. */
const NOWHERE = [0, 0, 0, 1e6];

/**
 * Converts a cut to the layout of the shaders.
 * @param toWorld From block-local coordinates.
 * @param toLocal Its inverse.
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
export const directionIn = (m: Matrix4, [x, y, z]: Vector3): number[] =>
  [0, 1, 2].map((k) => m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2] * z);

/** Mean scale factor of a matrix: the cube root of its scale of volumes. */
function sizeOf(m: Matrix4): number {
  const determinant =
    m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
  return Math.cbrt(Math.abs(determinant));
}
