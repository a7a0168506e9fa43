import type { ShDegree } from '../gaussian-cloud.js';
import type { OnnxHeader } from '../onnx/header.js';
import { checkContract } from './check-contract.js';
import { ContractError } from './contract-error.js';
import type { Contract, GaussianAttribute, OutputBinding, QuaternionOrder, ShOrder } from './contract.js';
import { oneInstance } from './instances.js';
import { findTensor, shDegreeOf } from './tensor-rules.js';

/**
 * Where one attribute of a Gaussian lies: in row i of `tensor` at the elements i·rowStride + offset … + components - 1. All
 * layouts of the contract come down to these.
 */
export interface AttributeSlice {
  readonly attribute: GaussianAttribute;
  /** Name of the output. */
  readonly tensor: string;
  /** Elements before the attribute in a row. */
  readonly offset: number;
  /** Elements of the attribute. */
  readonly components: number;
  /** Elements of a row. */
  readonly rowStride: number;
  /** What is to be undone: `logit` opacities, `log` scales. */
  readonly activation: 'linear' | 'logit' | 'log';
  /** Of rotations. */
  readonly quaternionOrder?: QuaternionOrder;
  /** Of spherical harmonics. */
  readonly shOrder?: ShOrder;
}

/** How a file writes Gaussians, with everything resolved. */
export interface GaussianLayout {
  /** Rows that a run writes at most, of one instance: N, or `nMax` where N is symbolic. */
  readonly capacity: number;
  /** True if the number of rows may differ from run to run. */
  readonly isDynamic: boolean;
  readonly dtype: 'float32' | 'float16';
  /** Undefined where colours are plain. */
  readonly shDegree: ShDegree | undefined;
  readonly attributes: readonly AttributeSlice[];
  /** Output [1] int32 that says how many rows live. */
  readonly count: string | undefined;
}

/**
 * Where each attribute of the Gaussians lies in the outputs of a file.
 * @returns undefined for a post-processor, which writes a picture.
 * @throws ContractError if the file does not keep the contract.
 */
export function gaussianLayout(header: OnnxHeader, contract: Contract): GaussianLayout | undefined {
  const faults = checkContract(header, contract);
  if (faults.length > 0) throw new ContractError(faults);
  const { outputs: written } = oneInstance(header, contract);
  const { outputs, nMax } = contract;
  if (outputs.layout === 'image') return undefined;
  const columnsOf = (tensor: string): number => {
    const dims = findTensor(written, tensor)!.dims!;
    return dims.slice(1).reduce<number>((product, dim) => product * Number(dim), 1);
  };
  const attributes = attributeSlices(outputs, columnsOf);
  const tensors = [...new Set(attributes.map(({ tensor }) => tensor))].map((name) => findTensor(written, name)!);
  const rows = tensors.map(({ dims }) => dims![0]).find((dim) => typeof dim === 'number');
  const sh = attributes.find(({ attribute }) => attribute === 'sh');
  return {
    capacity: typeof rows === 'number' ? rows : nMax!,
    isDynamic: typeof rows !== 'number',
    dtype: tensors[0].dtype as 'float32' | 'float16',
    shDegree: sh && shDegreeOf(outputs, findTensor(written, sh.tensor)!.dims!),
    attributes,
    count: outputs.count,
  };
}

/** Where each attribute lies. @param columnsOf elements of a row of an output. */
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
  const { gaussians: tensor, color, shOrder, opacityActivation } = outputs;
  const components = rowStride - 10;
  const slices: Slice[] = [
    linear('positions', 0, 3),
    linear('covariances', 3, 6),
    color === 'sh' ? { ...linear('sh', 9, components), shOrder } : linear('colors', 9, components),
    { ...linear('opacities', rowStride - 1, 1), activation: opacityActivation },
  ];
  return slices.map((slice) => ({ ...slice, tensor, rowStride }));
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
  const { scaleActivation = 'linear', rotationOrder, shOrder, opacityActivation } = outputs;
  const details: Readonly<Record<GaussianAttribute, Partial<Slice>>> = {
    positions: {},
    covariances: {},
    scales: { activation: scaleActivation },
    rotations: { quaternionOrder: rotationOrder },
    colors: {},
    sh: { shOrder },
    opacities: { activation: opacityActivation },
  };
  return (Object.keys(details) as GaussianAttribute[]).flatMap((attribute) => {
    const tensor = outputs[attribute];
    if (tensor === undefined) return [];
    const rowStride = columnsOf(tensor);
    return [{ ...linear(attribute, 0, rowStride), ...details[attribute], tensor, rowStride }];
  });
}
