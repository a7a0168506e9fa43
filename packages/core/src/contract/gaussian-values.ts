import type { ContractErrorCode } from '../errors.js';
import type { AttributeSlice } from './layout.js';

/** One attribute of the rows of a tensor, read as numbers. */
export interface RowReader extends AttributeSlice {
  readonly isHalf: boolean;
  readonly read: (row: number, component: number) => number;
}

export interface RowFault {
  readonly code: ContractErrorCode;
  readonly expected: string;
  readonly found: string;
  readonly remedy: string;
}

/** Relative rounding error of a float16: half a unit in the last place. */
const HALF_ROUNDING = 2 ** -11;
/** Relative rounding error of a float32: half a unit in the last place. */
const FLOAT_ROUNDING = 2 ** -24;
/** Absolute rounding error of float16 numbers near zero. */
const HALF_SMALLEST = 2 ** -25;
/** Tolerance of a covariance R·S·Sᵀ·Rᵀ, in roundings: computing it takes about ten for each number. */
const COVARIANCE_ROUNDINGS = 16;

/** Maximum standard deviation in world units: its square, a variance, must fit float32. */
const MAX_SCALE = 1e18;

/** Returns the fault of one attribute in one row; undefined if its values are valid. */
export function checkRow(reader: RowReader, row: number): RowFault | undefined {
  const { attribute, activation, components, read } = reader;
  for (let i = 0; i < components; i++) {
    const value = read(row, i);
    // Infinite logits are opacities of 0 and 1, and the logarithm -Infinity is a scale of 0, as in a flat disc.
    const isAllowed = activation === 'logit' ? !Number.isNaN(value) : activation === 'log' && value === -Infinity;
    if (!Number.isFinite(value) && !isAllowed) return notFinite(value);
  }
  switch (attribute) {
    case 'covariances':
      return checkCovariance(reader, row);
    case 'scales':
      return activation === 'linear' ? checkScale(reader, row) : undefined;
    case 'rotations':
      return checkRotation(reader, row);
    case 'opacities':
      return activation === 'linear' ? checkOpacity(reader, row) : undefined;
    default:
      return undefined;
  }
}

const notFinite = (value: number): RowFault => ({
  code: 'contract/not-finite',
  expected: 'finite numbers',
  found: String(value),
  remedy: 'find the operation that divides by zero or overflows; pad unused rows with opacity 0, not with NaN',
});

function checkOpacity({ read, isHalf }: RowReader, row: number): RowFault | undefined {
  const value = read(row, 0);
  const slack = isHalf ? HALF_ROUNDING : 1e-6;
  if (value >= -slack && value <= 1 + slack) return undefined;
  return {
    code: 'contract/opacity',
    expected: 'an opacity of 0 to 1',
    found: String(value),
    remedy: 'apply the sigmoid in the model, or declare opacityActivation "logit"',
  };
}

function checkScale({ read, components }: RowReader, row: number): RowFault | undefined {
  const scales = Array.from({ length: components }, (_, i) => read(row, i));
  if (scales.every((scale) => scale >= 0 && scale <= MAX_SCALE)) return undefined;
  return {
    code: 'contract/covariance',
    expected: 'standard deviations of 0 to 1e18',
    found: scales.join(' '),
    remedy: 'apply the exponential in the model, or declare scaleActivation "log"',
  };
}

function checkRotation({ read }: RowReader, row: number): RowFault | undefined {
  if ([0, 1, 2, 3].some((i) => read(row, i) !== 0)) return undefined;
  return {
    code: 'contract/covariance',
    expected: 'a quaternion other than zero',
    found: '0 0 0 0',
    remedy: 'write the identity where there is no rotation; pad unused rows with it, too',
  };
}

/** Indices of xx, xy, xz, yy, yz, zz in a row-major 3x3 matrix. */
const UPPER_TRIANGLE = [0, 1, 2, 4, 5, 8];

function checkCovariance({ read, isHalf, components }: RowReader, row: number): RowFault | undefined {
  const matrix = (components === 9 ? UPPER_TRIANGLE : [0, 1, 2, 3, 4, 5]).map((i) => read(row, i));
  const trace = matrix[0] + matrix[3] + matrix[5];
  const rounding = COVARIANCE_ROUNDINGS * FLOAT_ROUNDING + (isHalf ? HALF_ROUNDING : 0);
  // Rounding shifts an eigenvalue by at most the Frobenius norm of the errors.
  const slack = rounding * Math.abs(trace) + (isHalf ? 3 * HALF_SMALLEST : 0);
  const smallest = smallestEigenvalue(matrix);
  if (smallest >= -slack) return undefined;
  return {
    code: 'contract/covariance',
    expected: 'a positive semi-definite covariance xx xy xz yy yz zz',
    found: `${matrix.map((value) => Number(value.toPrecision(4))).join(' ')} with the eigenvalue ${smallest.toPrecision(3)}`,
    remedy: 'write R·S·S·Rᵀ, and check the order of the six numbers',
  };
}

/** Returns the smallest eigenvalue of the symmetric matrix xx, xy, xz, yy, yz, zz (trigonometric solution of the cubic). */
export function smallestEigenvalue([xx, xy, xz, yy, yz, zz]: readonly number[]): number {
  const mean = (xx + yy + zz) / 3;
  const [a, b, c] = [xx - mean, yy - mean, zz - mean];
  const spread = Math.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6);
  if (spread === 0) return mean;
  const determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
  const cosine = Math.min(1, Math.max(-1, determinant / (2 * spread ** 3)));
  return mean + 2 * spread * Math.cos(Math.acos(cosine) / 3 + (2 * Math.PI) / 3);
}
