import { ONNX_DTYPES, type OnnxDtype, type OnnxHeader, type OnnxNode, type OnnxValue } from './header.js';

const BOOLEANS = new Set('Equal Less LessOrEqual Greater GreaterOrEqual Not And Or Xor IsNaN IsInf'.split(' '));
const INT64 = new Set('Shape Size ArgMax ArgMin NonZero'.split(' '));
/** Operators whose output has the shape of the first input. */
const SAME_SHAPE = new Set('Cast Identity DequantizeLinear QuantizeLinear Neg Abs CastLike Dropout'.split(' '));

/**
 * Static analysis of the tensors of a graph: values that depend only on constants, which are computed once for a
 * session; element types; and shapes of weights, through the nodes between them and their consumer.
 */
export class GraphValues {
  readonly #header: OnnxHeader;
  readonly #makers = new Map<string, OnnxNode>();
  readonly #constants = new Set<string>();
  readonly #types = new Map<string, OnnxDtype>();

  constructor(header: OnnxHeader) {
    this.#header = header;
    for (const [name, { dtype }] of header.stored) {
      this.#constants.add(name);
      this.#types.set(name, dtype);
    }
    for (const { name, dtype } of [...header.inputs, ...header.values.values(), ...header.outputs]) {
      if (dtype !== 'unknown' && dtype !== 'undefined') this.#types.set(name, dtype);
    }
    for (const node of header.nodes) this.#add(node);
  }

  /** Whether a value is computed once. */
  isConstant(name: string): boolean {
    return this.#constants.has(name);
  }

  /** Whether a node depends only on constants. */
  isFolded({ inputs, operator }: OnnxNode): boolean {
    // The runtime draws new random numbers in every run.
    if (/^(Random|Bernoulli|Multinomial|Dropout)/.test(operator)) return false;
    // The runtime folds the shape of a tensor with fixed dimensions.
    if (operator === 'Shape' && this.dimsOf(inputs[0])?.every((dim) => dim !== null)) return true;
    return (
      operator === 'Constant' || (inputs.length > 0 && inputs.every((name) => name === '' || this.isConstant(name)))
    );
  }

  /** Whether any tensor has this type. */
  has(dtype: OnnxDtype): boolean {
    return [...this.#types.values()].includes(dtype);
  }

  makerOf(name: string): OnnxNode | undefined {
    return this.#makers.get(name);
  }

  dtypeOf(name: string): OnnxDtype | undefined {
    return this.#types.get(name);
  }

  /** Dimensions of a tensor; null for one that only a run determines, undefined if even the rank is unknown. */
  dimsOf(name: string, depth = 0): readonly (number | null)[] | undefined {
    const stored = this.#header.stored.get(name)?.dims;
    if (stored) return stored;
    const { inputs, outputs, values } = this.#header;
    const said = values.get(name) ?? [...inputs, ...outputs].find((tensor) => tensor.name === name);
    if (said?.dims) return said.dims.map((dim) => (typeof dim === 'number' ? dim : null));
    const maker = this.#makers.get(name);
    // Weights are at most a few nodes from their storage.
    return maker === undefined || depth > 16 ? undefined : this.#dimsFrom(maker, depth + 1);
  }

  #dimsFrom(node: OnnxNode, depth: number): readonly (number | null)[] | undefined {
    const { operator, inputs, value, lists } = node;
    if (operator === 'Constant') return value?.dims;
    const from = this.dimsOf(inputs[0], depth);
    if (SAME_SHAPE.has(operator)) return from;
    if (operator === 'Reshape') return reshaped(from, this.#integersOf(inputs[1], depth));
    if (operator === 'Transpose')
      return from && (lists?.perm ?? from.map((_, i) => from.length - 1 - i)).map((axis) => from[axis]);
    if (operator === 'Unsqueeze' || operator === 'Squeeze') {
      const axes = lists?.axes ?? this.#integersOf(inputs[1], depth);
      if (!from || !axes) return undefined;
      return operator === 'Unsqueeze' ? unsqueezed(from, axes) : squeezed(from, axes);
    }
    if (operator === 'Slice' || operator === 'Neg') return from?.map(() => null);
    if (operator === 'Gather' && from) {
      const index = this.dimsOf(inputs[1], depth);
      return index && [...index, ...from.slice(1)].map(() => null);
    }
    // Binary operators: scaled or shifted weights.
    if (['Mul', 'Add', 'Sub', 'Div'].includes(operator)) {
      const other = this.dimsOf(inputs[1], depth);
      return from && other && (from.length >= other.length ? from : other);
    }
    return undefined;
  }

  #integersOf(name: string | undefined, depth: number): readonly number[] | undefined {
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
    for (const [index, name] of node.outputs.entries()) {
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
