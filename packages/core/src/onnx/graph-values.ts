import {
  ONNX_DTYPES,
  type OnnxDtype,
  type OnnxHeader,
  type OnnxNode,
  type OnnxTensor,
  type OnnxValue,
} from './header.js';

const BOOLEANS = new Set('Equal Less LessOrEqual Greater GreaterOrEqual Not And Or Xor IsNaN IsInf'.split(' '));
const INT64 = new Set('Shape Size ArgMax ArgMin NonZero'.split(' '));
/** Operators whose output has dimensions of both of their inputs. */
const NEEDS_BOTH = new Set('Gather Mul Add Sub Div'.split(' '));
/** Operators whose output has the shape of their first input. */
const SAME_SHAPE = new Set('Cast Identity DequantizeLinear QuantizeLinear Neg Abs CastLike Dropout'.split(' '));

/** Maximum number of nodes between a tensor and the declared tensors that its dimensions follow from. */
const MAX_HOPS = 17;
/** Maximum rank of a tensor whose dimensions are known. */
const MAX_RANK = 64;

type Dims = readonly (number | null)[];

/** Dimensions that follow from those of declared tensors, through a number of nodes. */
interface Derived {
  readonly dims: Dims;
  readonly hops: number;
}

/**
 * Static analysis of the tensors of a graph. It finds their element types, the shapes of weights after nodes such as
 * Reshape, and the tensors that depend only on constants. The runtime computes the latter once for each session.
 */
export class GraphValues {
  readonly #header: OnnxHeader;
  readonly #makers = new Map<string, OnnxNode>();
  readonly #constants = new Set<string>();
  readonly #types = new Map<string, OnnxDtype>();
  /** Inputs and outputs by name. */
  readonly #ends = new Map<string, OnnxTensor>();
  /** Dimensions of computed tensors. Each node is evaluated once, because its inputs precede it in the file. */
  readonly #derived = new Map<string, Derived>();

  constructor(header: OnnxHeader) {
    this.#header = header;
    for (const [name, { dtype }] of header.stored) {
      this.#constants.add(name);
      this.#types.set(name, dtype);
    }
    for (const { name, dtype } of [...header.inputs, ...header.values.values(), ...header.outputs]) {
      if (dtype !== 'unknown' && dtype !== 'undefined') this.#types.set(name, dtype);
    }
    for (const end of [...header.inputs, ...header.outputs])
      if (!this.#ends.has(end.name)) this.#ends.set(end.name, end);
    for (const node of header.nodes) this.#add(node);
  }

  /** Whether a tensor depends only on constants, so that the runtime computes it once for each session. */
  isConstant(name: string): boolean {
    return this.#constants.has(name);
  }

  /** Whether a node depends only on constants, so that the runtime computes it once. */
  isFolded({ inputs, operator }: OnnxNode): boolean {
    // The runtime draws new random numbers in each run.
    if (/^(Random|Bernoulli|Multinomial|Dropout)/.test(operator)) return false;
    // The runtime folds the shape of a tensor with fixed dimensions.
    if (operator === 'Shape' && this.dimsOf(inputs[0])?.every((dim) => dim !== null)) return true;
    return (
      operator === 'Constant' || (inputs.length > 0 && inputs.every((name) => name === '' || this.isConstant(name)))
    );
  }

  /** Whether any tensor of the graph has this element type. */
  has(dtype: OnnxDtype): boolean {
    return [...this.#types.values()].includes(dtype);
  }

  makerOf(name: string): OnnxNode | undefined {
    return this.#makers.get(name);
  }

  dtypeOf(name: string): OnnxDtype | undefined {
    return this.#types.get(name);
  }

  /**
   * Returns the dimensions of a tensor; undefined if the rank is unknown. A dimension that only a run determines is
   * null.
   */
  dimsOf(name: string): Dims | undefined {
    return this.#find(name)?.dims;
  }

  #find(name: string): Derived | undefined {
    const stored = this.#header.stored.get(name)?.dims;
    if (stored) return { dims: stored, hops: 0 };
    const said = (this.#header.values.get(name) ?? this.#ends.get(name))?.dims;
    if (said) return { dims: said.map((dim) => (typeof dim === 'number' ? dim : null)), hops: 0 };
    return this.#derived.get(name);
  }

  /** Returns the dimensions of a node's outputs. Weights are at most a few nodes away from their stored tensor. */
  #derive(node: OnnxNode): Derived | undefined {
    const { operator, inputs, value } = node;
    if (operator === 'Constant') return value && { dims: value.dims, hops: 1 };
    const [from, other] = [0, 1].map((k) => (k < inputs.length ? this.#find(inputs[k]) : undefined));
    const dims = this.#dimsFrom(node, from?.dims, other?.dims);
    const hops = 1 + Math.max(from?.hops ?? 0, NEEDS_BOTH.has(operator) ? (other?.hops ?? 0) : 0);
    return dims && dims.length <= MAX_RANK && hops <= MAX_HOPS ? { dims, hops } : undefined;
  }

  #dimsFrom({ operator, inputs, lists }: OnnxNode, from: Dims | undefined, other: Dims | undefined): Dims | undefined {
    if (SAME_SHAPE.has(operator)) return from;
    if (operator === 'Reshape') return reshaped(from, this.#integersOf(inputs[1]));
    if (operator === 'Transpose')
      return from && (lists?.perm ?? from.map((_, i) => from.length - 1 - i)).map((axis) => from[axis]);
    if (operator === 'Unsqueeze' || operator === 'Squeeze') {
      const axes = lists?.axes ?? this.#integersOf(inputs[1]);
      if (!from || !axes) return undefined;
      return operator === 'Unsqueeze' ? unsqueezed(from, axes) : squeezed(from, axes);
    }
    if (operator === 'Slice' || operator === 'Neg') return from?.map(() => null);
    if (operator === 'Gather') return from && other && [...other, ...from.slice(1)].map(() => null);
    // These operators scale or shift weights. Their result is assumed to have the shape of the operand of higher rank.
    if (NEEDS_BOTH.has(operator)) return from && other && (from.length >= other.length ? from : other);
    return undefined;
  }

  #integersOf(name: string | undefined, depth = 0): readonly number[] | undefined {
    if (name === undefined || depth > 16) return undefined;
    const maker = this.#makers.get(name);
    const value: OnnxValue | undefined = this.#header.stored.get(name) ?? maker?.value;
    return (
      value?.integers ?? (maker?.operator === 'Identity' ? this.#integersOf(maker.inputs[0], depth + 1) : undefined)
    );
  }

  #add(node: OnnxNode): void {
    for (const name of node.outputs) if (name !== '') this.#makers.set(name, node);
    const isFolded = this.isFolded(node);
    const derived = this.#derive(node);
    for (const [index, name] of node.outputs.entries()) {
      if (derived) this.#derived.set(name, derived);
      if (isFolded && !node.isInner) this.#constants.add(name);
      const dtype = this.#types.get(name) ?? this.#typeFrom(node, index);
      if (dtype !== undefined) this.#types.set(name, dtype);
    }
  }

  #typeFrom({ operator, inputs, numbers, value }: OnnxNode, index: number): OnnxDtype | undefined {
    if (operator === 'Constant') return value?.dtype;
    if (operator === 'Cast') return dtypeOfNumber(numbers?.to);
    if (operator === 'ConstantOfShape') return value?.dtype ?? 'float32';
    if (INT64.has(operator) || (operator === 'TopK' && index === 1)) return 'int64';
    if (BOOLEANS.has(operator)) return 'bool';
    if (operator === 'DequantizeLinear') return this.#types.get(inputs[1]);
    if (operator === 'DynamicQuantizeLinear' || operator === 'QuantizeLinear') return index === 1 ? 'float32' : 'uint8';
    if (operator === 'MatMulInteger' || operator === 'ConvInteger') return 'int32';
    if (operator === 'Where') return this.#types.get(inputs[1]);
    return this.#types.get(inputs[0]);
  }
}

const dtypeOfNumber = (to: number | undefined): OnnxDtype | undefined =>
  to === undefined ? undefined : ONNX_DTYPES[to];

function reshaped(
  from: readonly (number | null)[] | undefined,
  shape: readonly number[] | undefined,
): readonly (number | null)[] | undefined {
  if (shape === undefined) return undefined;
  const filled = shape.map((size, axis) => (size === 0 ? (from?.[axis] ?? null) : size));
  const open = filled.indexOf(-1);
  if (open < 0) return filled;
  const rest = filled.reduce<number>((product, size, axis) => product * (axis === open ? 1 : (size ?? NaN)), 1);
  const total = from?.reduce<number>((product, size) => product * (size ?? NaN), 1) ?? NaN;
  return filled.map((size, axis) => (axis === open ? (Number.isInteger(total / rest) ? total / rest : null) : size));
}

function unsqueezed(from: readonly (number | null)[], axes: readonly number[]): readonly (number | null)[] {
  const rank = from.length + axes.length;
  const ones = new Set(axes.map((axis) => (axis + rank) % rank));
  const rest = [...from];
  return Array.from({ length: rank }, (_, axis) => (ones.has(axis) ? 1 : (rest.shift() ?? null)));
}

function squeezed(from: readonly (number | null)[], axes: readonly number[]): readonly (number | null)[] {
  const gone = new Set(axes.map((axis) => (axis + from.length) % from.length));
  return from.filter((_, axis) => !gone.has(axis));
}
