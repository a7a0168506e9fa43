/** Clouds written as generators write them, in any layout of the contract, and read again as plain float64 code would. */
import { halfToNumber, numberToHalf, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { AttributeSlice, GaussianAttribute, GaussianLayout } from '@gaussian-splat/core/contract';
import { eigenvectors, quaternionOf } from './symmetric.js';

const SH_C0 = 0.28209479177387814;

/** One way to write Gaussians. */
export interface TensorSpec {
  readonly layout: 'packed' | 'split';
  readonly shape: 'covariance' | 'scale' | 'log-scale';
  readonly quaternionOrder: 'wxyz' | 'xyzw';
  readonly color: 'rgb' | 'coefficient-major' | 'channel-major';
  readonly opacity: 'linear' | 'logit';
  readonly dtype: 'float32' | 'float16';
}

/** The tensors that a run would write. */
export interface WrittenTensors {
  readonly layout: GaussianLayout;
  /** 32-bit words of each tensor by its name. */
  readonly tensors: Readonly<Record<string, Uint32Array>>;
  /** The values of the rounded numbers in the tensors. */
  readonly cloud: GaussianCloud;
}

/** Writes a cloud. A spec with plain colors drops all harmonics but the first. */
export function writeTensors(cloud: GaussianCloud, spec: TensorSpec): WrittenTensors {
  const columns = attributeColumns(cloud, spec);
  const layout = layoutOf(columns, cloud, spec);
  const round = spec.dtype === 'float16' ? (x: number) => halfToNumber(numberToHalf(x)) : Math.fround;
  for (const values of columns.values()) values.forEach((x, i) => (values[i] = round(x)));
  return { layout, tensors: pack(columns, layout), cloud: readCloud(columns, cloud, spec) };
}

/** [N, components] of each attribute, before rounding. */
type Columns = Map<GaussianAttribute, Float64Array>;

function attributeColumns(cloud: GaussianCloud, spec: TensorSpec): Columns {
  const { count, positions, scales, rotations, opacities, sh, shDegree } = cloud;
  const table = (width: number, at: (row: number, k: number) => number): Float64Array =>
    Float64Array.from({ length: count * width }, (_, i) => at(Math.floor(i / width), i % width));
  const columns: Columns = new Map([['positions', table(3, (row, k) => positions[3 * row + k])]]);
  if (spec.shape === 'covariance') {
    const all = Array.from({ length: count }, (_, row) => covarianceOf(cloud, row));
    columns.set(
      'covariances',
      table(6, (row, k) => all[row][k]),
    );
  } else {
    const log = spec.shape === 'log-scale';
    columns.set(
      'scales',
      table(3, (row, k) => (log ? Math.log(scales[3 * row + k]) : scales[3 * row + k])),
    );
    const shift = spec.quaternionOrder === 'wxyz' ? 0 : 1;
    columns.set(
      'rotations',
      table(4, (row, k) => rotations[4 * row + ((k + shift) % 4)]),
    );
  }
  const coefficients = shCoefficientCount(shDegree);
  const coefficient = (row: number, c: number, channel: number): number => sh[3 * (coefficients * row + c) + channel];
  if (spec.color === 'rgb')
    columns.set(
      'colors',
      table(3, (row, k) => 0.5 + SH_C0 * coefficient(row, 0, k)),
    );
  else if (spec.color === 'coefficient-major')
    columns.set(
      'sh',
      table(3 * coefficients, (row, k) => coefficient(row, Math.floor(k / 3), k % 3)),
    );
  else
    columns.set(
      'sh',
      table(3 * coefficients, (row, k) => coefficient(row, k % coefficients, Math.floor(k / coefficients))),
    );
  const logit = (p: number): number => Math.log(p) - Math.log1p(-p);
  columns.set(
    'opacities',
    table(1, (row) => (spec.opacity === 'logit' ? logit(opacities[row]) : opacities[row])),
  );
  return columns;
}

function layoutOf(columns: Columns, { count, shDegree }: GaussianCloud, spec: TensorSpec): GaussianLayout {
  const widths = [...columns].map(([attribute, values]) => [attribute, values.length / count] as const);
  const total = widths.reduce((sum, [, width]) => sum + width, 0);
  let offset = 0;
  const attributes = widths.map(([attribute, components]): AttributeSlice => {
    const place =
      spec.layout === 'packed'
        ? { tensor: 'gaussians', offset, rowStride: total }
        : { tensor: attribute, offset: 0, rowStride: components };
    offset += components;
    return {
      ...{ attribute, components, ...place },
      activation: activationOf(attribute, spec),
      quaternionOrder: attribute === 'rotations' ? spec.quaternionOrder : undefined,
      shOrder: attribute === 'sh' && spec.color !== 'rgb' ? spec.color : undefined,
    };
  });
  return {
    capacity: count,
    isDynamic: false,
    dtype: spec.dtype,
    shDegree: spec.color === 'rgb' ? undefined : shDegree,
    attributes,
    count: undefined,
  };
}

function activationOf(attribute: GaussianAttribute, spec: TensorSpec): AttributeSlice['activation'] {
  if (attribute === 'opacities') return spec.opacity;
  return attribute === 'scales' && spec.shape === 'log-scale' ? 'log' : 'linear';
}

function pack(columns: Columns, layout: GaussianLayout): Record<string, Uint32Array> {
  const isHalf = layout.dtype === 'float16';
  const tensors: Record<string, Uint32Array> = {};
  for (const { attribute, tensor, offset, components, rowStride } of layout.attributes) {
    const values = columns.get(attribute)!;
    const words = (tensors[tensor] ??= new Uint32Array(Math.ceil((layout.capacity * rowStride) / (isHalf ? 2 : 1))));
    const target = isHalf ? new Uint16Array(words.buffer) : new Float32Array(words.buffer);
    for (let i = 0; i < values.length; i++) {
      const at = Math.floor(i / components) * rowStride + offset + (i % components);
      target[at] = isHalf ? numberToHalf(values[i]) : values[i];
    }
  }
  return tensors;
}

function readCloud(
  columns: Columns,
  { count, shDegree, origin, antialiased }: GaussianCloud,
  spec: TensorSpec,
): GaussianCloud {
  const column = (attribute: GaussianAttribute): Float64Array => columns.get(attribute)!;
  const { scales, rotations } = spec.shape === 'covariance' ? axesOf(column('covariances')) : axesFrom(columns, spec);
  const degree = spec.color === 'rgb' ? 0 : shDegree;
  const coefficients = shCoefficientCount(degree);
  const sh = Float32Array.from({ length: 3 * coefficients * count }, (_, i) => {
    const [row, k] = [Math.floor(i / (3 * coefficients)), i % (3 * coefficients)];
    if (spec.color === 'rgb') return (column('colors')[i] - 0.5) / SH_C0;
    if (spec.color === 'coefficient-major') return column('sh')[i];
    return column('sh')[3 * coefficients * row + (k % 3) * coefficients + Math.floor(k / 3)];
  });
  const sigmoid = (x: number): number => 1 / (1 + Math.exp(-x));
  return {
    count,
    origin,
    positions: Float32Array.from(column('positions')),
    scales,
    rotations,
    opacities: Float32Array.from(column('opacities'), spec.opacity === 'logit' ? sigmoid : (x) => x),
    sh,
    shDegree: degree,
    antialiased,
    droppedCount: 0,
  };
}

function axesFrom(columns: Columns, spec: TensorSpec): { scales: Float32Array; rotations: Float32Array } {
  const written = columns.get('rotations')!;
  const shift = spec.quaternionOrder === 'wxyz' ? 0 : 3;
  return {
    scales: Float32Array.from(columns.get('scales')!, spec.shape === 'log-scale' ? Math.exp : (x) => x),
    rotations: Float32Array.from(written, (_, i) => written[i - (i % 4) + ((i + shift) % 4)]),
  };
}

/** Axes of covariances; what rounding has made negative is flat. */
function axesOf(covariances: Float64Array): { scales: Float32Array; rotations: Float32Array } {
  const count = covariances.length / 6;
  const [scales, rotations] = [new Float32Array(3 * count), new Float32Array(4 * count)];
  for (let i = 0; i < count; i++) {
    const { values, vectors } = eigenvectors(covariances.subarray(6 * i, 6 * i + 6));
    scales.set(
      values.map((value) => Math.sqrt(Math.max(0, value))),
      3 * i,
    );
    rotations.set(quaternionOf(vectors), 4 * i);
  }
  return { scales, rotations };
}

/** xx, xy, xz, yy, yz, zz of a splat, in float64. */
export function covarianceOf({ rotations, scales }: GaussianCloud, i: number): number[] {
  const norm = Math.hypot(rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]);
  const [w, x, y, z] = Array.from(rotations.subarray(4 * i, 4 * i + 4), (q) => q / norm);
  const rows = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ].map((row) => row.map((value, k) => value * scales[3 * i + k]));
  const dot = (a: number, b: number): number => rows[a].reduce((sum, value, k) => sum + value * rows[b][k], 0);
  return [dot(0, 0), dot(0, 1), dot(0, 2), dot(1, 1), dot(1, 2), dot(2, 2)];
}
