/** Grammars of the attributes that place a child: see ../camera/grammar.ts. */
import type { Vector3 } from '@gaussian-splat/core';
import { angleGrammar, numberGrammar, parsePoint, type AttributeGrammar } from './grammar.js';

const terms = (text: string): string[] => text.trim().split(/\s+/);

/** Grammar of `position`; values are in meters. */
export const pointGrammar: AttributeGrammar<Vector3> = {
  expected: '"x y z" in meters (or with m, cm or mm)',
  fallback: '0 0 0',
  parse: parsePoint,
};

const { parse: parseAngle } = angleGrammar('0');

/** Grammar of `rotation`; values are in radians. */
export const anglesGrammar: AttributeGrammar<Vector3> = {
  expected: '"x y z", angles with deg or rad',
  fallback: '0 0 0',
  parse: (text) => {
    const [x, y, z, ...rest] = terms(text.toLowerCase()).map(parseAngle);
    const isWhole = typeof x === 'number' && typeof y === 'number' && typeof z === 'number' && rest.length === 0;
    return isWhole ? [x, y, z] : null;
  },
};

/** Grammar of `scale`: one factor, or a factor for each axis. */
export const scaleGrammar: AttributeGrammar<Vector3> = {
  expected: 'a number, or "x y z"',
  fallback: '1',
  parse: (text) => {
    const numbers = terms(text).map(Number);
    const [x, y = x, z = x] = numbers;
    return (numbers.length === 1 || numbers.length === 3) && numbers.every(Number.isFinite) ? [x, y, z] : null;
  },
};

/** Grammar of `opacity`, 0..1. */
export const opacityGrammar = numberGrammar(1, 0, 'a number from 0 to 1', 1);

/** Grammar of `crop`: the 6 coordinates of the minimum and the maximum corner; undefined for no crop. */
export const boxGrammar: AttributeGrammar<readonly number[] | undefined> = {
  expected: '"x y z x y z" in meters, two corners of a box, the least first',
  fallback: 'none',
  parse: (text) => {
    if (text === 'none') return undefined;
    const each = terms(text);
    const [min, max] = [parsePoint(each.slice(0, 3).join(' ')), parsePoint(each.slice(3).join(' '))];
    return min && max && min.every((lowest, axis) => lowest <= max[axis]) ? [...min, ...max] : null;
  },
};
