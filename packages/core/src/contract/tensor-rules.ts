import type { ShDegree } from '../gaussian-cloud.js';
import type { OnnxDim, OnnxDtype, OnnxTensor } from '../onnx/header.js';
import type {
  Activations,
  GaussianAttribute,
  GaussianTensor,
  InputBinding,
  OutputBinding,
  PackedOutputs,
  PoseInput,
  ShOrder,
} from './contract.js';

/**
 * Rule for one dimension of a shape. A number is the required size. `N` (Gaussians), `H` and `W` (image sizes) allow any
 * size, also a symbolic one. Another letter allows any size that the file fixes.
 */
export type DimRule = number | string;

/** Allowed shapes and element types of a tensor. */
export interface TensorRule {
  readonly shapes: readonly (readonly DimRule[])[];
  readonly dtypes: readonly OnnxDtype[];
}

const FLOATS: readonly OnnxDtype[] = ['float32', 'float16'];
const INTEGERS: readonly OnnxDtype[] = ['int32', 'int64'];
const SH_DEGREES: readonly ShDegree[] = [0, 1, 2, 3];
/** Number of elements of position, covariance and opacity in a packed row. */
export const PACKED_FIXED_COLUMNS = 10;

/** Returns the number of spherical-harmonics coefficients of all three channels: 3(d+1)². */
export const shColumns = (degree: ShDegree): number => 3 * (degree + 1) ** 2;

const one = (dtypes: readonly OnnxDtype[]): TensorRule => ({ shapes: [[1], []], dtypes });
const fixed = (dtypes: readonly OnnxDtype[], ...shapes: (readonly DimRule[])[]): TensorRule => ({ shapes, dtypes });

/** Returns the rule for an input; undefined for controls and states, which may have any fixed shape. */
export function inputRule(binding: InputBinding): TensorRule | undefined {
  switch (binding.role) {
    case 'view':
    case 'camera_to_world':
    case 'projection':
    case 'view_projection':
      return fixed(['float32'], [4, 4], [16]);
    case 'intrinsics':
      return fixed(['float32'], [3, 3], [4]);
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
      return fixed(['float32'], ...POSE_SHAPES[binding.format]);
    case 'shape':
      return fixed(['float32'], ['B']);
    case 'image':
      return fixed(FLOATS, ...IMAGE_SHAPES, ['V', 3, 'H', 'W'], ['V', 4, 'H', 'W']);
    case 'depth':
      return fixed(FLOATS, [1, 1, 'H', 'W'], [1, 'H', 'W'], ['H', 'W']);
    case 'gaussians':
      // Another model's count is computed in GPU memory, which has no 64-bit integers.
      return binding.attribute === 'count' ? one(['int32']) : gaussianRule(binding.attribute, binding);
    case 'control':
    case 'state':
      return undefined;
  }
}

/** Shapes of one image: planes of red, green, blue and optionally alpha. */
const IMAGE_SHAPES: readonly (readonly DimRule[])[] = [
  [1, 3, 'H', 'W'],
  [1, 4, 'H', 'W'],
  [3, 'H', 'W'],
  [4, 'H', 'W'],
];

/** Shapes of each format of poses: one row for each joint, or flat. */
const POSE_SHAPES: Readonly<Record<PoseInput['format'], readonly (readonly DimRule[])[]>> = {
  'axis-angle': [['J', 3], ['P']],
  quaternion: [['J', 4], ['P']],
  matrix: [['J', 3, 3], ['J', 9], ['P']],
  parameters: [['P']],
};

/** Number of elements for each joint; 1 for model-specific parameters, which have no joints. */
export const POSE_NUMBERS: Readonly<Record<PoseInput['format'], number>> = {
  'axis-angle': 3,
  quaternion: 4,
  matrix: 9,
  parameters: 1,
};

/**
 * Returns the rule for a tensor of Gaussians.
 * @param fixedColumns Number of elements in a packed row without colors or harmonics.
 */
export function gaussianRule(
  tensor: GaussianTensor,
  { color, shOrder }: Activations,
  fixedColumns = PACKED_FIXED_COLUMNS,
): TensorRule {
  switch (tensor) {
    case 'packed':
      return color === 'rgb'
        ? fixed(FLOATS, ['N', fixedColumns + 3])
        : fixed(FLOATS, ...SH_DEGREES.map((degree) => ['N', fixedColumns + shColumns(degree)]));
    case 'positions':
      return fixed(FLOATS, ['N', 3]);
    case 'scales':
      return fixed(FLOATS, ['N', 3], ['N', 1], ['N']);
    case 'colors':
      return fixed(FLOATS, ['N', 3], ['N', 4]);
    case 'covariances':
      return fixed(FLOATS, ['N', 6], ['N', 3, 3]);
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
        ...SH_DEGREES.map((degree) => ['N', shColumns(degree)]),
      );
    case 'count':
      return one(INTEGERS);
  }
}

/** Returns the order of harmonics that the shape of their tensor allows; coefficient-major if it allows both. */
export function shOrderOf({ dims }: Pick<OnnxTensor, 'dims'>): ShOrder {
  const isFit = dims === undefined || shapeFits(dims, gaussianRule('sh', { shOrder: 'coefficient-major' }));
  return isFit ? 'coefficient-major' : 'channel-major';
}

/** Returns the number of elements in a packed row without colors or harmonics. */
export function fixedColumnsOf({ columns }: Pick<PackedOutputs, 'columns'>): number {
  return columns?.reduce((sum, attribute) => sum + PACKED_WIDTHS[attribute], 0) ?? PACKED_FIXED_COLUMNS;
}

/** Number of elements of each attribute in a packed row; 0 for colors and harmonics, which take the rest of the row. */
export const PACKED_WIDTHS: Readonly<Record<GaussianAttribute, number>> = {
  positions: 3,
  covariances: 6,
  scales: 3,
  rotations: 4,
  opacities: 1,
  colors: 0,
  sh: 0,
};

/** Returns the rule for the output that a field of the binding names. */
export function outputRule(binding: OutputBinding, field: string): TensorRule {
  if (binding.layout === 'image') return fixed(FLOATS, ...IMAGE_SHAPES);
  if (field === 'count') return gaussianRule('count', {});
  if (binding.layout === 'packed') return gaussianRule('packed', binding, fixedColumnsOf(binding));
  if (binding.layout === 'split') return gaussianRule(field as GaussianTensor, binding);
  if (field === 'gaussians') return fixed(FLOATS, ['N', 10]);
  if (field === 'colors') return fixed(FLOATS, ['N', 4], ['N', 3]);
  return fixed(FLOATS, ...SH_DEGREES.map((degree) => ['N', shColumns(degree)]));
}

/** Whether the dimensions of a tensor match a shape of the rule, except for leading dimensions of 1. */
export function shapeFits(dims: readonly OnnxDim[], rule: TensorRule): boolean {
  return bareDims(dims, rule) !== undefined;
}

/**
 * Returns the dimensions of a tensor after removing as few leading dimensions of 1 as necessary to match a shape of the
 * rule. Such a dimension, a batch of one, does not affect the order of the elements. Undefined if no shape matches.
 */
export function bareDims(dims: readonly OnnxDim[], { shapes }: TensorRule): readonly OnnxDim[] | undefined {
  const fits = shapes.some((shape) => shape.length === dims.length && shape.every((rule, i) => dimFits(dims[i], rule)));
  if (fits) return dims;
  return dims[0] === 1 ? bareDims(dims.slice(1), { shapes, dtypes: [] }) : undefined;
}

function dimFits(dim: OnnxDim, rule: DimRule): boolean {
  if (typeof rule === 'number') return dim === rule;
  if (['N', 'H', 'W'].includes(rule)) return dim !== 0;
  return typeof dim === 'number' && dim > 0;
}

/** Returns the shapes of a rule as text: `[N, 3] or [N, 4]`. */
export function describeShapes({ shapes }: TensorRule): string {
  return shapes.map((shape) => `[${shape.join(', ')}]`).join(' or ');
}

/** Returns the degree of the harmonics in a tensor with a valid shape; undefined if the tensor contains none. */
export function shDegreeOf(binding: OutputBinding, dims: readonly OnnxDim[]): ShDegree | undefined {
  if (binding.layout === 'image') return undefined;
  if (binding.layout === 'packed') {
    return binding.color === 'sh' ? degreeOfColumns(Number(dims[1]) - fixedColumnsOf(binding)) : undefined;
  }
  return degreeOfColumns(dims.slice(1).reduce<number>((product, dim) => product * Number(dim), 1));
}

function degreeOfColumns(columns: number): ShDegree | undefined {
  return SH_DEGREES.find((degree) => shColumns(degree) === columns);
}

/** Returns the tensor with a name; undefined if there is none. */
export const findTensor = (tensors: readonly OnnxTensor[], name: string): OnnxTensor | undefined =>
  tensors.find((tensor) => tensor.name === name);
