/** Element types of ONNX tensors, indexed by their number in the format; `undefined` if a file declares none. */
export const ONNX_DTYPES = [
  'undefined',
  'float32',
  'uint8',
  'int8',
  'uint16',
  'int16',
  'int32',
  'int64',
  'string',
  'bool',
  'float16',
  'float64',
  'uint32',
  'uint64',
  'complex64',
  'complex128',
  'bfloat16',
  'float8e4m3fn',
  'float8e4m3fnuz',
  'float8e5m2',
  'float8e5m2fnuz',
  'uint4',
  'int4',
  'float4e2m1',
] as const;

/** Element type of a tensor, or the kind of an input or output that is not a tensor. */
export type OnnxDtype =
  (typeof ONNX_DTYPES)[number] | 'sequence' | 'map' | 'optional' | 'sparse tensor' | 'opaque' | 'unknown';

/** A dimension: a number, a symbol of the file, or null if the file does not declare it. */
export type OnnxDim = number | string | null;

/** An input or output of the graph. */
export interface OnnxTensor {
  readonly name: string;
  readonly dtype: OnnxDtype;
  /** Undefined if the file does not even declare the rank. */
  readonly dims: readonly OnnxDim[] | undefined;
}

/** A file beside the model with some of its weights. */
export interface ExternalFile {
  /** Path relative to the model's folder, as in the model. */
  readonly location: string;
  /** Minimum length of the file in bytes; 0 if the model does not declare it. */
  readonly byteLength: number;
}

/** A tensor stored in the file: its type and shape, and its numbers if it is the shape of another. */
export interface OnnxValue {
  readonly dtype: OnnxDtype;
  readonly dims: readonly number[];
  /** Only for short vectors of int64. */
  readonly integers?: readonly number[];
}

/** A node of the graph, without its weights. */
export interface OnnxNode {
  readonly name: string;
  /** As in {@link OnnxHeader.operators}. */
  readonly operator: string;
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
  /** Whether the node is within a subgraph or a function. */
  readonly isInner: boolean;
  /** Attributes that are integers, and lists of integers. */
  readonly numbers?: Readonly<Record<string, number>>;
  readonly lists?: Readonly<Record<string, readonly number[]>>;
  /** Tensor of the attribute `value`, as in `Constant`. */
  readonly value?: OnnxValue;
}

/** Description of an ONNX file, without its weights. */
export interface OnnxHeader {
  /** File name or address, for messages. */
  readonly name: string;
  /** Length of the file in bytes. */
  readonly byteLength: number;
  readonly irVersion: number;
  /** Program that wrote the file, with its version, or empty. */
  readonly producer: string;
  readonly graphName: string;
  /** Operator sets by domain; that of ONNX itself is `ai.onnx`. */
  readonly opsets: ReadonlyMap<string, number>;
  /** `metadata_props`. */
  readonly metadata: ReadonlyMap<string, string>;
  /** Inputs that a caller must provide: initializers have a default and are excluded. */
  readonly inputs: readonly OnnxTensor[];
  /**
   * Names of inputs that are initializers, too: their stored value is used, because ONNX Runtime Web accepts no other.
   */
  readonly optionalInputs: readonly string[];
  readonly outputs: readonly OnnxTensor[];
  /**
   * Number of occurrences of each operator, subgraphs included: `MatMul`, or `com.example:Name` outside ONNX's own
   * domain.
   */
  readonly operators: ReadonlyMap<string, number>;
  /** All nodes in the order of the file, those of subgraphs and functions before the node that contains them. */
  readonly nodes: readonly OnnxNode[];
  /** Tensors stored in the file, by name. */
  readonly stored: ReadonlyMap<string, OnnxValue>;
  /** Declared types and shapes of intermediate values. */
  readonly values: ReadonlyMap<string, OnnxTensor>;
  /** Operators that the file itself defines, named as in {@link operators}. */
  readonly functions: ReadonlySet<string>;
  readonly externalFiles: readonly ExternalFile[];
  /** Bytes of weights within the file. */
  readonly initializerBytes: number;
}

/** Formats a tensor's type and shape: `float32 [N, 13]`. */
export function describeTensor({ dtype, dims }: Pick<OnnxTensor, 'dtype' | 'dims'>): string {
  return `${dtype} ${dims ? `[${dims.map((dim) => dim ?? '?').join(', ')}]` : 'of unknown shape'}`;
}
