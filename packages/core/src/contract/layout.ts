import type { ShDegree } from '../gaussian-cloud.js';
import type { OnnxHeader } from '../onnx/header.js';
import { checkContract } from './check-contract.js';
import { ContractError } from './contract-error.js';
import type { Activations, Contract, GaussianAttribute, OutputBinding, QuaternionOrder, ShOrder } from './contract.js';
import { oneInstance } from './instances.js';
import { bareDims, findTensor, outputRule, PACKED_WIDTHS, shDegreeOf } from './tensor-rules.js';
import type { OnnxDim } from '../onnx/header.js';
import { tensorNames } from './parse-contract.js';

/**
 * Location of one attribute in an output. Row i of the output contains it in the `components` elements from
 * i · `rowStride` + `offset`. All layouts of the contract are converted to slices.
 */
export interface AttributeSlice {
  readonly attribute: GaussianAttribute;
  /** Name of the output. */
  readonly tensor: string;
  /** Offset of the attribute in a row, in elements. */
  readonly offset: number;
  /** Number of elements of the attribute: 9 for covariance matrices, 1 for a scale of all axes. */
  readonly components: number;
  /** Number of elements in a row. */
  readonly rowStride: number;
  /** Encoding of the numbers, which the reader must invert: `logit` of opacities, `log` of scales. */
  readonly activation: 'linear' | 'logit' | 'log';
  /** Order of the quaternions' components; only for rotations. */
  readonly quaternionOrder?: QuaternionOrder;
  /** Order of the coefficients; only for spherical harmonics. */
  readonly shOrder?: ShOrder;
}

/** Layout of the Gaussians of a file, with all defaults resolved. */
export interface GaussianLayout {
  /** Maximum number of valid rows in a run of one instance: N, or `nMax` if that is less or N is symbolic. */
  readonly capacity: number;
  /** Number of rows of the tensors if it is more than {@link capacity}, because of padding. */
  readonly paddedRows?: number;
  /** Whether the number of rows may differ between runs. */
  readonly isDynamic: boolean;
  readonly dtype: 'float32' | 'float16';
  /** Degree of the spherical harmonics; undefined for plain colors. */
  readonly shDegree: ShDegree | undefined;
  readonly attributes: readonly AttributeSlice[];
  /** Name of the output with the number of valid rows, undefined if there is none: [1] int32, or int64 whose low word is read. */
  readonly count: string | undefined;
  /** Element type of {@link count}. Default: int32. */
  readonly countDtype?: 'int32' | 'int64';
}

/**
 * Returns the location of each attribute of the Gaussians in the outputs of a file; undefined for a post-processor, whose
 * output is an image.
 * @throws ContractError if the file violates the contract.
 */
export function gaussianLayout(header: OnnxHeader, contract: Contract): GaussianLayout | undefined {
  const faults = checkContract(header, contract);
  if (faults.length > 0) throw new ContractError(faults);
  const { outputs: written } = oneInstance(header, contract);
  const { outputs, nMax } = contract;
  if (outputs.layout === 'image') return undefined;
  const fields = new Map(tensorNames(outputs).map(([field, name]) => [name, field]));
  const dimsOf = (tensor: string): readonly OnnxDim[] =>
    bareDims(findTensor(written, tensor)!.dims!, outputRule(outputs, fields.get(tensor)!))!;
  const columnsOf = (tensor: string): number =>
    dimsOf(tensor)
      .slice(1)
      .reduce<number>((product, dim) => product * Number(dim), 1);
  const attributes = attributeSlices(outputs, columnsOf);
  const tensors = [...new Set(attributes.map(({ tensor }) => tensor))].map((name) => findTensor(written, name)!);
  const rows = tensors.map(({ name }) => dimsOf(name)[0]).find((dim) => typeof dim === 'number');
  const sh = attributes.find(({ attribute }) => attribute === 'sh');
  const count = outputs.count === undefined ? undefined : findTensor(written, outputs.count);
  return {
    capacity: Math.min(rows ?? Infinity, nMax ?? Infinity),
    ...(rows !== undefined && nMax !== undefined && nMax < rows ? { paddedRows: rows } : {}),
    ...(count?.dtype === 'int64' ? { countDtype: 'int64' as const } : {}),
    isDynamic: typeof rows !== 'number',
    dtype: tensors[0].dtype as 'float32' | 'float16',
    shDegree: sh && shDegreeOf(outputs, dimsOf(sh.tensor)),
    attributes,
    count: outputs.count,
  };
}

/** Returns the location of each attribute. @param columnsOf Returns the number of elements in a row of an output. */
export function attributeSlices(outputs: OutputBinding, columnsOf: (tensor: string) => number): AttributeSlice[] {
  switch (outputs.layout) {
    case 'image':
      return [];
    case 'packed':
      return packedSlices(outputs, columnsOf(outputs.gaussians));
    case 'visionary':
      return visionarySlices(outputs, columnsOf);
    case 'split':
      return splitSlices(outputs, columnsOf);
  }
}

type Slice = Omit<AttributeSlice, 'tensor' | 'rowStride'>;
const linear = (attribute: GaussianAttribute, offset: number, components: number): Slice => ({
  attribute,
  offset,
  components,
  activation: 'linear',
});

function packedSlices(outputs: OutputBinding & { layout: 'packed' }, rowStride: number): AttributeSlice[] {
  const { gaussians: tensor, color, columns } = outputs;
  const order = columns ?? (['positions', 'covariances', color === 'sh' ? 'sh' : 'colors', 'opacities'] as const);
  const others = order.reduce((sum, attribute) => sum + PACKED_WIDTHS[attribute], 0);
  const details = activationsOf(outputs);
  let offset = 0;
  return order.map((attribute) => {
    const components = PACKED_WIDTHS[attribute] || rowStride - others;
    const slice = { ...linear(attribute, offset, components), ...details[attribute], tensor, rowStride };
    offset += components;
    return slice;
  });
}

/** Returns the properties of each attribute that the encoding determines. */
function activationsOf({
  scaleActivation = 'linear',
  rotationOrder,
  shOrder,
  opacityActivation = 'linear',
}: Activations): Readonly<Record<GaussianAttribute, Partial<Slice>>> {
  return {
    positions: {},
    covariances: {},
    scales: { activation: scaleActivation },
    rotations: { quaternionOrder: rotationOrder },
    colors: {},
    sh: { shOrder },
    opacities: { activation: opacityActivation },
  };
}

function visionarySlices(
  { gaussians, colors, sh }: OutputBinding & { layout: 'visionary' },
  columnsOf: (tensor: string) => number,
): AttributeSlice[] {
  const geometry = [linear('positions', 0, 3), linear('opacities', 3, 1), linear('covariances', 4, 6)];
  const slices: AttributeSlice[] = geometry.map((slice) => ({ ...slice, tensor: gaussians, rowStride: 10 }));
  if (colors !== undefined) slices.push({ ...linear('colors', 0, 3), tensor: colors, rowStride: columnsOf(colors) });
  if (sh !== undefined) {
    const rowStride = columnsOf(sh);
    slices.push({ ...linear('sh', 0, rowStride), tensor: sh, rowStride, shOrder: 'coefficient-major' });
  }
  return slices;
}

function splitSlices(
  outputs: OutputBinding & { layout: 'split' },
  columnsOf: (tensor: string) => number,
): AttributeSlice[] {
  const details = activationsOf(outputs);
  return (Object.keys(details) as GaussianAttribute[]).flatMap((attribute) => {
    const tensor = outputs[attribute];
    if (tensor === undefined) return [];
    const rowStride = columnsOf(tensor);
    // The fourth component of colors with alpha is ignored.
    const components = attribute === 'colors' ? 3 : rowStride;
    return [{ ...linear(attribute, 0, components), ...details[attribute], tensor, rowStride }];
  });
}
