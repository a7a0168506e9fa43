import { lookAt, numberToHalf, type Camera, type Vector3 } from '@gaussian-splat/core';
import { oneInstance, type Contract, type GaussiansInput } from '@gaussian-splat/core/contract';
import type { OnnxHeader, OnnxTensor } from '@gaussian-splat/core/onnx';
import { bindInputs, type GeneratorState } from '@gaussian-splat/generator';

/** One input of a run: float16 as bits. */
export interface SampleTensor {
  readonly dtype: string;
  readonly dims: readonly number[];
  readonly data: Float32Array | Uint16Array | Int32Array | BigInt64Array;
}

export interface Sample {
  /** Description of the sample, for the table. */
  readonly label: string;
  /** Whether controls, poses and shapes have their defaults: declared bounds must then hold. */
  readonly isDefault: boolean;
  readonly inputs: Readonly<Record<string, SampleTensor>>;
}

/** Rows of the Gaussians for an input of a chain with a symbolic N, and pixels of images with symbolic sizes. */
const SAMPLE_ROWS = 16;
const SAMPLE_PIXELS = 64;

/** Sampled fractions of the duration, besides its ends and its middle. */
const TIMES = [0.13, 0.25, 0.37, 0.62, 0.75, 0.89];

/**
 * Inputs of one instance for runs at the limits that the contract declares: times and views at defaults, then controls.
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
    // No simple fractions of a period, because a loop would be in the same state for all of them.
    for (const [i, share] of TIMES.entries()) {
      states.push([`${share} of the time`, stateAt(contract, 2 + i, share * end)]);
    }
  }
  if (Object.values(contract.inputs).some(({ role }) => role === 'control')) {
    states.push(['controls at least', stateAt(contract, 0, 0, 0)], ['controls at most', stateAt(contract, 0, 0, 1)]);
  }
  return states.map(([label, state]) => ({
    label,
    isDefault: state.controls === undefined,
    inputs: { ...bindInputs(one, contract, state), ...given },
  }));
}

/** @param controlEnd End of the ranges of controls; undefined for their defaults. */
function stateAt(contract: Contract, angle: number, timeSeconds: number, controlEnd?: 0 | 1): GeneratorState {
  const camera = cameraFor(contract, angle);
  if (controlEnd === undefined) return { camera, timeSeconds };
  const controls: Record<string, number> = {};
  for (const [name, binding] of Object.entries(contract.inputs)) {
    if (binding.role === 'control') controls[name] = binding.range[controlEnd];
  }
  return { camera, timeSeconds, controls };
}

/** A view of 640x480 pixels around the declared bounds, or around the unit box. */
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

/** Tensors that the page does not set: images, and Gaussians of another generator. */
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

/** Nothing in the first columns, then a surface that recedes. */
function sampleDepth(input: OnnxTensor): SampleTensor {
  const dims = fixedDims(input, SAMPLE_PIXELS);
  const [size, width] = [dims.reduce((product, dim) => product * dim, 1), dims.at(-1)!];
  return toSample(
    input,
    dims,
    Array.from({ length: size }, (_, i) => (4 * i < width ? 0 : 0.5 + (10 * (i % width)) / width)),
  );
}

/** State before the first run. */
function sampleState(input: OnnxTensor, value = 0): SampleTensor {
  const dims = fixedDims(input, 1);
  return toSample(input, dims, new Array<number>(dims.reduce((product, dim) => product * dim, 1)).fill(value));
}

/** Small round Gaussians along a line. */
function sampleGaussians(input: OnnxTensor, binding: GaussiansInput): SampleTensor {
  const dims = fixedDims(input, SAMPLE_ROWS);
  if (binding.attribute === 'count') return toSample(input, dims, [SAMPLE_ROWS]);
  const columns = dims.slice(1).reduce((product, dim) => product * dim, 1);
  const rows = Array.from({ length: dims[0] }, (_, i) => sampleRow(binding, columns, i / dims[0]));
  return toSample(input, dims, rows.flat());
}

function sampleRow(binding: GaussiansInput, columns: number, share: number): number[] {
  const { attribute, opacityActivation, scaleActivation, rotationOrder, color } = binding;
  const covariance = [0.01, 0, 0, 0.01, 0, 0.01];
  const opacity = opacityActivation === 'logit' ? 0 : 0.5;
  const colors = new Array<number>(attribute === 'packed' ? columns - 10 : columns).fill(color === 'rgb' ? 0.5 : 0.1);
  switch (attribute) {
    case 'packed':
      return [share, 0, 0, ...covariance, ...colors, opacity];
    case 'positions':
      return [share, 0, 0];
    case 'covariances':
      return covariance;
    case 'scales':
      return [0.1, 0.1, 0.1].map((scale) => (scaleActivation === 'log' ? Math.log(scale) : scale));
    case 'rotations':
      return rotationOrder === 'xyzw' ? [0, 0, 0, 1] : [1, 0, 0, 0];
    case 'opacities':
      return [opacity];
    default:
      return colors;
  }
}
