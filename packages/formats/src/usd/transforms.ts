import { matrixOfQuaternion } from '@gaussian-splat/core';
import { quote } from '../bytes.js';
import { damaged } from '../faults.js';
import { multiply, type Affine } from '../gltf/nodes.js';
import { shownPath, valueAt, type UsdPrim, type UsdValue } from './layer.js';

const IDENTITY: Affine = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
const AXES = 'XYZ';

type Numbers = ArrayLike<number>;

/**
 * Returns the function that maps prims to the transforms from their coordinates to those of the stage, at a time code.
 * @param name Name of the file in error messages.
 */
export function placesAt(time: number, name: string): (prim: UsdPrim) => Affine {
  const known = new Map<UsdPrim, Affine>();
  return (prim) => {
    const open: UsdPrim[] = [];
    let at: UsdPrim | undefined = prim;
    for (; at && !known.has(at); at = at.parent) open.push(at);
    let toStage = at ? known.get(at)! : IDENTITY;
    for (const one of open.reverse()) {
      const { isAbsolute, local } = localOf(one, time, name);
      toStage = isAbsolute ? local : multiply(toStage, local);
      known.set(one, toStage);
    }
    return toStage;
  };
}

/** Returns the transform of a prim to its parent; `isAbsolute` if it ignores that of the parent. */
function localOf(prim: UsdPrim, time: number, name: string): { isAbsolute: boolean; local: Affine } {
  const order = valueAt(prim.attributes.get('xformOpOrder'), time);
  let [isAbsolute, local] = [false, IDENTITY];
  if (!Array.isArray(order)) return { isAbsolute, local };
  // An order may name an attribute any number of times, and its value may be long.
  const operations = new Map<string, Affine>();
  for (const word of order as string[]) {
    if (word === '!resetXformStack!') {
      [isAbsolute, local] = [true, IDENTITY];
      continue;
    }
    const [, invert, attribute = '', operation = ''] = /^(!invert!)?(xformOp:([^:]+).*)$/.exec(word) ?? [];
    const known = operations.get(attribute) ?? ownOf(prim, attribute, operation, time);
    if (!known?.every(Number.isFinite))
      throw damaged(
        `${name}, ${shownPath(prim)}`,
        'transforms by translate, rotate, orient, scale and transform',
        quote(word),
        'decode/unsupported',
      );
    operations.set(attribute, known);
    const own = invert ? inverse(known) : known;
    // The first operation of the list is the last one that applies to a point.
    local = multiply(local, own);
  }
  return { isAbsolute, local };
}

/** Returns the transform of an attribute, which is none without a value; undefined for unknown operations. */
function ownOf(prim: UsdPrim, attribute: string, operation: string, time: number): Affine | undefined {
  if (operation === '') return undefined;
  const value = valueAt(prim.attributes.get(attribute), time);
  return value === undefined ? IDENTITY : operationOf(operation, numbersOf(value));
}

function numbersOf(value: UsdValue | undefined): Numbers {
  if (typeof value === 'number') return [value];
  return value instanceof Float32Array || value instanceof Float64Array ? value : [];
}

/** Returns the transform of an operation; undefined for unknown ones, and for other counts of numbers. */
function operationOf(operation: string, v: Numbers): Affine | undefined {
  const [, kind, axes] = /^(translate|scale|rotate)([XYZ]*)$/.exec(operation) ?? [];
  if (operation === 'transform') return v.length === 16 ? columnsOf(v) : undefined;
  if (operation === 'orient') return v.length === 4 ? turnOf(v) : undefined;
  if (kind === undefined || v.length !== (axes.length === 1 ? 1 : 3)) return undefined;
  if (kind === 'rotate') {
    // The first axis of the name turns first.
    if (axes.length === 1) return rotation(axes, v[0]);
    if (axes.length !== 3) return undefined;
    return [...axes].reduce<Affine>((sum, axis) => multiply(rotation(axis, v[AXES.indexOf(axis)]), sum), IDENTITY);
  }
  const neutral = kind === 'scale' ? 1 : 0;
  const [x, y, z] = axes.length === 1 ? [...AXES].map((axis) => (axis === axes ? v[0] : neutral)) : Array.from(v);
  return kind === 'scale' ? [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0] : [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z];
}

/** Transposes a matrix for row vectors, [4, 4]. */
const columnsOf = (m: Numbers): Affine => Array.from({ length: 12 }, (_, k) => m[4 * (k % 4) + Math.floor(k / 4)]);

/** Rotation about an axis by degrees. */
function rotation(axis: string, degrees: number): Affine {
  const [c, s] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  if (axis === 'X') return [1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0];
  if (axis === 'Y') return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0];
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0];
}

/**
 * Rotation by a quaternion (w, x, y, z). As in OpenUSD, w alone gives the angle, so that files whose quaternions do not
 * have length 1 look the same.
 */
function turnOf(q: Numbers): Affine {
  const length = Math.hypot(q[1], q[2], q[3]);
  if (length === 0) return IDENTITY;
  const w = Math.min(1, Math.max(-1, q[0]));
  const [x, y, z] = [1, 2, 3].map((k) => (q[k] / length) * Math.sqrt(1 - w * w));
  const m = matrixOfQuaternion(w, x, y, z);
  return [...m.slice(0, 3), 0, ...m.slice(3, 6), 0, ...m.slice(6), 0];
}

/** Inverse of a transform. Its numbers are not finite if it has none. */
function inverse(m: Affine): Affine {
  const cofactor = (row: number, column: number): number => {
    const [a, b] = [4 * ((row + 1) % 3), 4 * ((row + 2) % 3)];
    const [c, d] = [(column + 1) % 3, (column + 2) % 3];
    return m[a + c] * m[b + d] - m[a + d] * m[b + c];
  };
  const volume = m[0] * cofactor(0, 0) + m[1] * cofactor(0, 1) + m[2] * cofactor(0, 2);
  const rows = [0, 1, 2].map((row) => [0, 1, 2].map((column) => cofactor(column, row) / volume));
  return rows.flatMap((row) => [...row, -(row[0] * m[3] + row[1] * m[7] + row[2] * m[11])]);
}
