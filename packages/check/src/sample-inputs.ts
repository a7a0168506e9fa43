import { lookAt, numberToHalf, type Camera, type Vector3 } from '@gaussian-splat/core';
import { bareDims, inputRule, oneInstance, type Contract, type GaussiansInput } from '@gaussian-splat/core/contract';
import type { OnnxHeader, OnnxTensor } from '@gaussian-splat/core/onnx';
import { bindInputs, type GeneratorState } from '@gaussian-splat/generator';

/** One input of a run. Data of float16 are bits in a Uint16Array. */
export interface SampleTensor {
  readonly dtype: string;
  readonly dims: readonly number[];
  readonly data: Float32Array | Uint16Array | Int32Array | BigInt64Array;
}

export interface Sample {
  /** Description of the sample for the table. */
  readonly label: string;
  /** Whether controls, poses and shapes have their defaults, so that the output must lie in the declared bounds. */
  readonly isDefault: boolean;
  readonly inputs: Readonly<Record<string, SampleTensor>>;
}

/** Sizes that replace symbolic dimensions: rows of the Gaussians in a chain, and pixels of each side of an image. */
const SAMPLE_ROWS = 16;
const SAMPLE_PIXELS = 64;

/** Fractions of the duration that are sampled besides its ends and its middle. */
const TIMES = [0.13, 0.25, 0.37, 0.62, 0.75, 0.89];

/**
 * Returns the inputs of one instance for runs at the limits that the contract declares: first at several times and
 * views with default controls, then with the ends of the controls' ranges.
 */
export function sampleInputs(header: OnnxHeader, contract: Contract): Sample[] {
  const given = givenTensors(header, contract);
  const one = oneInstance(header, contract);
  const end = contract.duration ?? 1;
  const states: [label: string, state: GeneratorState][] = [
    ['defaults', stateAt(contract, 0, 0)],
    ['mid time, another view', stateAt(contract, 2, 0.5 * end)],
    ['last time, a third view', stateAt(contract, 4, end)],
  ];
  if (Object.values(contract.inputs).some(({ role }) => role === 'time' || role === 'frame')) {
    // The times are no simple fractions of a period, because a loop could be in the same state at all of those.
    for (const [i, share] of TIMES.entries()) {
      states.push([`${share} of the time`, stateAt(contract, 2 + i, share * end)]);
    }
  }
  if (Object.values(contract.inputs).some(({ role }) => role === 'control')) {
    states.push(
      ['controls at their minimum', stateAt(contract, 0, 0, 0)],
      ['controls at their maximum', stateAt(contract, 0, 0, 1)],
    );
  }
  return states.map(([label, state]) => ({
    label,
    isDefault: state.controls === undefined,
    inputs: { ...bindInputs(one, contract, state), ...given },
  }));
}

/**
 * Returns the state for a view and a time.
 * @param angle Azimuth of the view, radians.
 * @param controlEnd End of the ranges of all controls; undefined for their defaults.
 */
function stateAt(contract: Contract, angle: number, timeSeconds: number, controlEnd?: 0 | 1): GeneratorState {
  const camera = cameraFor(contract, angle);
  if (controlEnd === undefined) return { camera, timeSeconds };
  const controls: Record<string, number> = {};
  for (const [name, binding] of Object.entries(contract.inputs)) {
    if (binding.role === 'control') controls[name] = binding.range[controlEnd];
  }
  return { camera, timeSeconds, controls };
}

/** Returns a camera with 640x480 pixels that frames the declared bounds, or else the box from -1 to 1. */
function cameraFor({ bounds, coordinates }: Contract, angle: number): Camera {
  const { min, max } = bounds ?? { min: [-1, -1, -1], max: [1, 1, 1] };
  const center = min.map((low, axis) => (low + max[axis]) / 2) as unknown as Vector3;
  const distance = 1.5 * Math.hypot(...max.map((high, axis) => high - min[axis])) || 3;
  const [sign, axis] = [...(coordinates?.up ?? '-y')];
  const up = ['x', 'y', 'z'].map((name) => (name === axis ? (sign === '-' ? -1 : 1) : 0));
  const around = ['x', 'y', 'z'].map((name, i) =>
    name === axis ? 0.3 * up[i] : Math.sin(angle + (i === (axis === 'x' ? 1 : 0) ? 0 : Math.PI / 2)),
  );
  const eye = center.map((value, i) => value + distance * around[i]) as unknown as Vector3;
  const worldToCamera = lookAt(eye, center, up as unknown as Vector3);
  return { width: 640, height: 480, fx: 500, fy: 500, cx: 320, cy: 240, worldToCamera, near: 0.2, far: 1000 };
}

/**
 * Returns tensors for inputs that the page does not set: images, depths, states, and Gaussians of another generator.
 */
function givenTensors(header: OnnxHeader, contract: Contract): Record<string, SampleTensor> {
  const tensors: Record<string, SampleTensor> = {};
  for (const input of header.inputs) {
    const binding = contract.inputs[input.name];
    if (binding.role === 'image') tensors[input.name] = sampleImage(input);
    if (binding.role === 'depth') tensors[input.name] = sampleDepth(input);
    if (binding.role === 'state') tensors[input.name] = sampleState(input, binding.default);
    if (binding.role === 'gaussians') tensors[input.name] = sampleGaussians(input, binding);
  }
  return tensors;
}

function toSample({ dtype }: OnnxTensor, dims: readonly number[], numbers: readonly number[]): SampleTensor {
  if (dtype === 'float16') return { dtype, dims, data: Uint16Array.from(numbers, numberToHalf) };
  if (dtype === 'int32') return { dtype, dims, data: Int32Array.from(numbers) };
  return { dtype, dims, data: Float32Array.from(numbers) };
}

const fixedDims = ({ dims }: OnnxTensor, symbolic: number): number[] =>
  (dims ?? []).map((dim) => (typeof dim === 'number' ? dim : symbolic));

function sampleImage(input: OnnxTensor): SampleTensor {
  const dims = fixedDims(input, SAMPLE_PIXELS);
  const size = dims.reduce((product, dim) => product * dim, 1);
  return toSample(
    input,
    dims,
    Array.from({ length: size }, (_, i) => (i % dims.at(-1)!) / dims.at(-1)!),
  );
}

/** Returns a depth that is 0, for no surface, in the first columns, and then increases to the right. */
function sampleDepth(input: OnnxTensor): SampleTensor {
  const dims = fixedDims(input, SAMPLE_PIXELS);
  const [size, width] = [dims.reduce((product, dim) => product * dim, 1), dims.at(-1)!];
  return toSample(
    input,
    dims,
    Array.from({ length: size }, (_, i) => (4 * i < width ? 0 : 0.5 + (10 * (i % width)) / width)),
  );
}

/** Returns a state tensor as before the first run. */
function sampleState(input: OnnxTensor, value = 0): SampleTensor {
  const dims = fixedDims(input, 1);
  return toSample(input, dims, new Array<number>(dims.reduce((product, dim) => product * dim, 1)).fill(value));
}

/** Returns small round Gaussians along a line. */
function sampleGaussians(input: OnnxTensor, binding: GaussiansInput): SampleTensor {
  const dims = fixedDims(input, SAMPLE_ROWS);
  if (binding.attribute === 'count') return toSample(input, dims, [SAMPLE_ROWS]);
  // The checked header has a shape of the rule, perhaps after dimensions of 1.
  const [count, ...row] = bareDims(dims, inputRule(binding)!) as readonly number[];
  const columns = row.reduce((product, dim) => product * dim, 1);
  const rows = Array.from({ length: count }, (_, i) => sampleRow(binding, columns, i / count));
  return toSample(input, dims, rows.flat());
}

/** Covariance xx, xy, xz, yy, yz, zz of a ball. */
const COVARIANCE = [0.01, 0, 0, 0.01, 0, 0.01];

function sampleRow(binding: GaussiansInput, columns: number, share: number): number[] {
  const { attribute, opacityActivation, scaleActivation, rotationOrder, color } = binding;
  const opacity = opacityActivation === 'logit' ? 0 : 0.5;
  const colors = new Array<number>(attribute === 'packed' ? columns - 10 : columns).fill(color === 'rgb' ? 0.5 : 0.1);
  switch (attribute) {
    case 'packed':
      return [share, 0, 0, ...COVARIANCE, ...colors, opacity];
    case 'positions':
      return [share, 0, 0];
    case 'covariances':
      return columns === 9 ? [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01] : COVARIANCE;
    case 'scales':
      return new Array<number>(columns).fill(scaleActivation === 'log' ? Math.log(0.1) : 0.1);
    case 'rotations':
      return rotationOrder === 'xyzw' ? [0, 0, 0, 1] : [1, 0, 0, 0];
    case 'opacities':
      return [opacity];
    default:
      return colors;
  }
}
