import { eyeOf, GaussianSplatError, type Camera } from '@gaussian-splat/core';
import type { Contract, InputBinding } from '@gaussian-splat/core/contract';
import { describeTensor, type OnnxHeader, type OnnxTensor } from '@gaussian-splat/core/onnx';
import {
  cameraToWorld,
  inOrder,
  intrinsicsOf,
  projectionMatrix,
  viewMatrix,
  viewProjectionMatrix,
} from './camera-matrices.js';
import type { InputNumbers } from './input-value.js';
import type { GeneratorState } from './state.js';

/**
 * Returns the values of a generator's inputs, in the conventions of its contract. Excludes inputs with the roles
 * `gaussians`, `image`, `depth` and `state`: their tensors come from another generator, an image or the previous run.
 * @param header Header of a valid file (`checkContract` has found no faults); for a model of several instances, the
 * header of one (`oneInstance`).
 * @throws GaussianSplatError `argument/value` if the state lacks a camera, or if a value has the wrong length or is not
 * finite.
 */
export function bindInputs(
  header: OnnxHeader,
  contract: Contract,
  state: GeneratorState,
): Record<string, InputNumbers> {
  const values: Record<string, InputNumbers> = {};
  const { pose, shape, controls } = state;
  const chosen = {
    ...partsOf('pose', header, contract, pose),
    ...partsOf('shape', header, contract, shape),
    ...controls,
  };
  for (const input of header.inputs) {
    const { name } = input;
    const binding = contract.inputs[name];
    if (isGiven(binding)) continue;
    values[name] = toTensor(input, numbersOf(input, binding, contract, state, chosen[name]));
  }
  return values;
}

/**
 * Returns the numbers of each pose or shape that `all` contains, in the order of the file's inputs; none without `all`.
 */
function partsOf(
  role: 'pose' | 'shape',
  { inputs }: OnnxHeader,
  contract: Contract,
  all: ArrayLike<number> | undefined,
): Record<string, ArrayLike<number>> {
  const own = inputs.filter(({ name }) => contract.inputs[name].role === role);
  if (all === undefined) return {};
  // The length of a single one is checked with its tensor.
  if (own.length === 1) return { [own[0].name]: all };
  const size = own.reduce((sum, input) => sum + sizeOf(input), 0);
  if (all.length !== size)
    throw wrong(own.map(({ name }) => name).join(', '), `${size} numbers in all`, `${all.length}`);
  let start = 0;
  return Object.fromEntries(own.map((input) => [input.name, Array.from(all).slice(start, (start += sizeOf(input)))]));
}

/** Bindings of inputs whose tensors are not made of a state's numbers. */
type GivenInput = Extract<InputBinding, { role: 'gaussians' | 'image' | 'depth' | 'state' }>;

const isGiven = (binding: InputBinding): binding is GivenInput =>
  ['gaussians', 'image', 'depth', 'state'].includes(binding.role);

function numbersOf(
  input: OnnxTensor,
  binding: Exclude<InputBinding, GivenInput>,
  contract: Contract,
  state: GeneratorState,
  chosen: number | ArrayLike<number> | undefined,
): ArrayLike<number> {
  const { timeSeconds = 0 } = state;
  const camera = (): Camera => requireCamera(state.camera, input.name, binding.role);
  switch (binding.role) {
    case 'view':
      return inOrder(viewMatrix(camera(), binding.axes ?? 'RDF'), binding.order ?? 'row-major');
    case 'camera_to_world':
      return inOrder(cameraToWorld(camera(), binding.axes ?? 'RDF'), binding.order ?? 'row-major');
    case 'intrinsics':
      return intrinsicsOf(camera(), binding.unit, sizeOf(input) === 9);
    case 'projection':
      return inOrder(projectionMatrix(camera(), binding.axes ?? 'RDF'), binding.order ?? 'row-major');
    case 'view_projection':
      return inOrder(viewProjectionMatrix(camera()), binding.order ?? 'row-major');
    case 'camera_position':
      return eyeOf(camera().worldToCamera);
    case 'viewport':
      return [camera().width, camera().height];
    case 'time':
      return [binding.unit === 'seconds' ? timeSeconds : timeSeconds / contract.duration!];
    case 'frame':
      return [state.frame ?? frameAt(timeSeconds, contract)];
    case 'seed':
      return [state.seed ?? 0];
    case 'pose':
      return filled(input, chosen ?? binding.default ?? restPose(input, binding));
    case 'shape':
      return filled(input, chosen ?? binding.default ?? 0);
    case 'control':
      return filled(input, chosen ?? binding.default);
  }
}

/** Tolerance for rounding, as a fraction of a frame: in float64, 29/25 s times 25 is less than 29. */
const FRAME_ROUNDING = 1e-6;

/** Returns the index of the frame at a time. The end of the duration belongs to the last frame. */
function frameAt(timeSeconds: number, { fps = 0, duration = Infinity }: Contract): number {
  const last = Math.ceil(duration * fps - FRAME_ROUNDING) - 1;
  return Math.max(0, Math.min(Math.floor(timeSeconds * fps + FRAME_ROUNDING), fps > 0 ? last : 0));
}

/** Returns the flattened pose without rotation: zeros, or the identity for quaternions and matrices. */
function restPose(input: OnnxTensor, { format, quaternionOrder }: InputBinding & { role: 'pose' }): number[] {
  const quaternion = quaternionOrder === 'xyzw' ? [0, 0, 0, 1] : [1, 0, 0, 0];
  const joint = { quaternion, matrix: [1, 0, 0, 0, 1, 0, 0, 0, 1], 'axis-angle': [0], parameters: [0] }[format];
  return Array.from({ length: sizeOf(input) }, (_, i) => joint[i % joint.length]);
}

const filled = (input: OnnxTensor, value: number | ArrayLike<number>): ArrayLike<number> =>
  typeof value === 'number' ? new Array<number>(sizeOf(input)).fill(value) : value;

const sizeOf = ({ dims }: OnnxTensor): number =>
  (dims ?? []).reduce<number>((product, dim) => product * Number(dim), 1);

function toTensor(input: OnnxTensor, numbers: ArrayLike<number>): InputNumbers {
  const { name, dtype } = input;
  if (numbers.length !== sizeOf(input)) {
    throw wrong(name, `${sizeOf(input)} numbers for ${describeTensor(input)}`, `${numbers.length}`);
  }
  const bad = Array.prototype.find.call(numbers, (value: unknown) => !Number.isFinite(value)) as unknown;
  if (bad !== undefined) throw wrong(name, 'finite numbers', String(bad));
  const dims = (input.dims ?? []).map(Number);
  if (dtype === 'float32') return { dtype, dims, data: Float32Array.from(numbers) };
  const whole = Array.from(numbers, Math.round);
  if (dtype === 'int32') return { dtype, dims, data: Int32Array.from(whole) };
  if (dtype === 'int64') return { dtype, dims, data: BigInt64Array.from(whole, (value) => BigInt(value)) };
  throw wrong(name, 'an input of float32, int32 or int64', dtype);
}

function requireCamera(camera: Camera | undefined, name: string, role: string): Camera {
  if (camera?.worldToCamera?.length === 16) return camera;
  const isThree = (camera as { isCamera?: boolean } | undefined)?.isCamera === true;
  throw new GaussianSplatError('argument/value', {
    where: `input ${name} (${role})`,
    expected: 'a camera of @gaussian-splat/core in the state of the generator',
    found: camera === undefined ? 'none' : isThree ? 'a camera of three.js' : 'an object without worldToCamera',
    remedy: isThree
      ? 'give the state that SplatRenderer.stateOf(camera, model) of @gaussian-splat/three returns'
      : 'set camera before the generator runs; cameraFromProjection makes one from two matrices',
  });
}

function wrong(name: string, expected: string, found: string): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: `input ${name}`,
    expected,
    found,
    remedy: 'set a value that fits the input, as its contract declares',
  });
}
