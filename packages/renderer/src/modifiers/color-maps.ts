import type { Vector3 } from '@gaussian-splat/core';

/** An affine map of sRGB-encoded colors, 3 rows of 4 numbers: factors of red, green and blue, and a constant. */
export type ColorMap = readonly number[];

export const UNCHANGED: ColorMap = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/** Weights of red, green and blue in the luma of ITU-R BT.709. */
const LUMA = [0.2126, 0.7152, 0.0722];

/** Interpolates from the identity to a map. @param amount Fraction of the map, 0 to 1. */
const partly = (map: ColorMap, amount: number): ColorMap =>
  map.map((value, k) => UNCHANGED[k] + amount * (value - UNCHANGED[k]));

/**
 * Returns a map that replaces all colors by shades of one color; white gives shades of gray.
 * @param color Red, green and blue, 0..1.
 * @param amount Fraction of the change, 0 to 1.
 */
export const tinted = (color: Vector3, amount: number): ColorMap =>
  partly(
    color.flatMap((channel) => [...LUMA.map((weight) => channel * weight), 0]),
    amount,
  );

/** Returns a map that moves colors toward white, or toward black for a negative amount. @param amount -1 to 1. */
export const lightened = (amount: number): ColorMap =>
  partly(amount < 0 ? UNCHANGED.map(() => 0) : UNCHANGED.map((_, k) => (k % 4 === 3 ? 1 : 0)), Math.abs(amount));

/**
 * Returns a map that rotates hues, like `hue-rotate` of CSS (W3C Filter Effects).
 * @param angle Radians.
 * @param amount Fraction of the change, 0 to 1.
 */
export function recolored(angle: number, amount = 1): ColorMap {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const map = [
    ...[0.213 + 0.787 * c - 0.213 * s, 0.715 - 0.715 * c - 0.715 * s, 0.072 - 0.072 * c + 0.928 * s, 0],
    ...[0.213 - 0.213 * c + 0.143 * s, 0.715 + 0.285 * c + 0.14 * s, 0.072 - 0.072 * c - 0.283 * s, 0],
    ...[0.213 - 0.213 * c - 0.787 * s, 0.715 - 0.715 * c + 0.715 * s, 0.072 + 0.928 * c + 0.072 * s, 0],
  ];
  return partly(map, amount);
}
