import { inverse, multiply, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import type { ModifierCut } from '../generated/modified-layouts.js';
import type { StructValues } from '../gpu/struct.js';
import { opticalFactor } from '../page-table.js';
import { UNCHANGED, type ColorMap } from './color-maps.js';

export const CUT_SHAPES = ['box', 'sphere', 'cylinder', 'plane'] as const;

/** A unit cube, or a sphere or a cylinder (axis y) of diameter and height 1, about the origin; or all that lies below the plane y = 0. */
export type CutShape = (typeof CUT_SHAPES)[number];

/** A part of space in which splats are drawn otherwise. A splat at its edge changes by the share of it that lies inside. */
export interface SplatCut {
  readonly shape: CutShape;
  /** Row-major 4x4, last row (0, 0, 0, 1): from the shape's coordinates to the world. */
  readonly shapeToWorld: Matrix4;
  /** Which side of the surface changes. Default: `inside`. */
  readonly side?: 'inside' | 'outside' | undefined;
  /** Standard deviation of the edge in world units, besides the splat's own; `hard` decides by the centers of splats. Default: 0. */
  readonly edge?: number | 'hard' | undefined;
  /** Factor of the opacity, 0 to 1; 0 hides. Default: 1. */
  readonly opacity?: number | undefined;
  /** Opacity of a surface that is opaque otherwise, 0 to 1, as `Placement.opacity`. Default: 1. */
  readonly surfaceOpacity?: number | undefined;
  /** Default: colors stay as they are. */
  readonly color?: ColorMap | undefined;
  /** Displacement in world units. Default: none. */
  readonly offset?: Vector3 | undefined;
}

/** Each by its name: an access by a computed one would keep all constants in the bundle. */
const NUMBERS: Readonly<Record<CutShape, number>> = {
  box: constants.CUT_BOX,
  sphere: constants.CUT_SPHERE,
  cylinder: constants.CUT_CYLINDER,
  plane: constants.CUT_PLANE,
};

/** In place of the map to a shape that has no volume: everything lies outside. */
const NOWHERE = [0, 0, 0, 1e6];

/**
 * A cut as the shaders want it.
 * @param toWorld from page-local coordinates
 * @param toLocal its inverse
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

/** A direction through the linear part of a matrix. */
export const directionIn = (m: Matrix4, [x, y, z]: Vector3): number[] =>
  [0, 1, 2].map((k) => m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2] * z);

/** By how much a matrix makes lengths longer: the cube root of what it does to volumes. */
function sizeOf(m: Matrix4): number {
  const determinant =
    m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
  return Math.cbrt(Math.abs(determinant));
}
