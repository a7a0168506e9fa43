import type { ShDegree } from '../gaussian-cloud.js';
import type { OnnxDim, OnnxDtype, OnnxTensor } from '../onnx/header.js';
import type { Activations, GaussianTensor, InputBinding, OutputBinding } from './contract.js';

/**
 * One dimension of a shape: a number; `N`, the number of Gaussians, which may stay symbolic; `H` or `W`, sizes of a picture,
 * which may, too; or another letter, any size that the file must fix.
 */
export type DimRule = number | string;

/** What a tensor of some role must look like: one of the shapes, one of the element types. */
export interface TensorRule {
  readonly shapes: readonly (readonly DimRule[])[];
  readonly dtypes: readonly OnnxDtype[];
}

const FLOATS: readonly OnnxDtype[] = ['float32', 'float16'];
const INTEGERS: readonly OnnxDtype[] = ['int32', 'int64'];
const SH_DEGREES: readonly ShDegree[] = [0, 1, 2, 3];
/** Position, covariance and opacity of a packed row. */
export const PACKED_FIXED_COLUMNS = 10;

/** Coefficients of all three channels: 3(d+1)². */
export const shColumns = (degree: ShDegree): number => 3 * (degree + 1) ** 2;

const one = (dtypes: readonly OnnxDtype[]): TensorRule => ({ shapes: [[1], []], dtypes });
const fixed = (dtypes: readonly OnnxDtype[], ...shapes: (readonly DimRule[])[]): TensorRule => ({ shapes, dtypes });

/** What the input of a role must look like; undefined where any fixed shape will do. */
export function inputRule(binding: InputBinding): TensorRule | undefined {
  switch (binding.role) {
    case 'view':
    case 'projection':
    case 'view_projection':
      return fixed(['float32'], [4, 4]);
    case 'camera_position':
      return fixed(['float32'], [3]);
    case 'viewport':
      return fixed(['float32'], [2]);
    case 'time':
      return one(['float32']);
    case 'frame':
    case 'seed':
      return one(INTEGERS);
    case 'pose':
      return fixed(['float32'], { 'axis-angle': ['J', 3], quaternion: ['J', 4], parameters: ['P'] }[binding.format]);
    case 'shape':
      return fixed(['float32'], ['B']);
    case 'image':
      return fixed(FLOATS, [1, 3, 'H', 'W']);
    case 'gaussians':
      return gaussianRule(binding.attribute, binding);
    case 'control':
      return undefined;
  }
}

/** What a tensor of Gaussians must look like. */
export function gaussianRule(tensor: GaussianTensor, { color, shOrder }: Activations): TensorRule {
  switch (tensor) {
    case 'packed':
      return color === 'rgb'
        ? fixed(FLOATS, ['N', PACKED_FIXED_COLUMNS + 3])
        : fixed(FLOATS, ...SH_DEGREES.map((degree) => ['N', PACKED_FIXED_COLUMNS + shColumns(degree)]));
    case 'positions':
    case 'scales':
    case 'colors':
      return fixed(FLOATS, ['N', 3]);
    case 'covariances':
      return fixed(FLOATS, ['N', 6]);
    case 'rotations':
      return fixed(FLOATS, ['N', 4]);
    case 'opacities':
      return fixed(FLOATS, ['N'], ['N', 1]);
    case 'sh':
      return fixed(
        FLOATS,
        ...SH_DEGREES.map((degree) => {
          const coefficients = (degree + 1) ** 2;
          return shOrder === 'channel-major' ? ['N', 3, coefficients] : ['N', coefficients, 3];
        }),
      );
    case 'count':
      return one(['int32']);
  }
}

/** What the output that a field of the binding names must look like. */
export function outputRule(binding: OutputBinding, field: string): TensorRule {
  if (binding.layout === 'image') return fixed(FLOATS, [1, 3, 'H', 'W']);
  if (field === 'count') return gaussianRule('count', {});
  if (binding.layout === 'packed') return gaussianRule('packed', binding);
  if (binding.layout === 'split') return gaussianRule(field as GaussianTensor, binding);
  if (field === 'gaussians') return fixed(FLOATS, ['N', 10]);
  if (field === 'colors') return fixed(FLOATS, ['N', 4], ['N', 3]);
  return fixed(FLOATS, ...SH_DEGREES.map((degree) => ['N', shColumns(degree)]));
}

/** True if the file's dimensions are those of one of the shapes. */
export function shapeFits(dims: readonly OnnxDim[], { shapes }: TensorRule): boolean {
  return shapes.some((shape) => shape.length === dims.length && shape.every((rule, i) => dimFits(dims[i], rule)));
}

function dimFits(dim: OnnxDim, rule: DimRule): boolean {
  if (typeof rule === 'number') return dim === rule;
  if (['N', 'H', 'W'].includes(rule)) return dim !== 0;
  return typeof dim === 'number' && dim > 0;
}

/** The shapes of a rule for people: `[N, 3] or [N, 4]`. */
export function describeShapes({ shapes }: TensorRule): string {
  return shapes.map((shape) => `[${shape.join(', ')}]`).join(' or ');
}

/** Degree of the harmonics in a tensor whose shape fits; undefined if it holds none. */
export function shDegreeOf(binding: OutputBinding, dims: readonly OnnxDim[]): ShDegree | undefined {
  if (binding.layout === 'image') return undefined;
  if (binding.layout === 'packed') {
    return binding.color === 'sh' ? degreeOfColumns(Number(dims[1]) - PACKED_FIXED_COLUMNS) : undefined;
  }
  return degreeOfColumns(dims.slice(1).reduce<number>((product, dim) => product * Number(dim), 1));
}

function degreeOfColumns(columns: number): ShDegree | undefined {
  return SH_DEGREES.find((degree) => shColumns(degree) === columns);
}

/** Name, shape and type of a tensor that may be missing from a file. */
export const findTensor = (tensors: readonly OnnxTensor[], name: string): OnnxTensor | undefined =>
  tensors.find((tensor) => tensor.name === name);
