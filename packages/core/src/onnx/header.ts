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

/** A dimension: its size, its symbol in the file, or null if the file does not declare it. */
export type OnnxDim = number | string | null;

/** An input or output of the graph. */
export interface OnnxTensor {
  readonly name: string;
  readonly dtype: OnnxDtype;
  /** Dimensions; undefined if the file does not declare the rank. */
  readonly dims: readonly OnnxDim[] | undefined;
}

/** A file beside the model that contains some of its weights. */
export interface ExternalFile {
  /** Path relative to the model's folder, as stated in the model. */
  readonly location: string;
  /** Minimum length of the file in bytes; 0 if the model does not declare it. */
  readonly byteLength: number;
}

/** A tensor stored in the file: its type and shape, and its integers if it is the shape of another tensor. */
export interface OnnxValue {
  readonly dtype: OnnxDtype;
  readonly dims: readonly number[];
  /** Values of a short vector of int64; undefined for other tensors. */
  readonly integers?: readonly number[];
}

/** A node of the graph, without its weights. */
export interface OnnxNode {
  readonly name: string;
  /** Name of the operator, as in {@link OnnxHeader.operators}. */
  readonly operator: string;
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
  /** Whether the node is within a subgraph or a function. */
  readonly isInner: boolean;
  /** Attributes that are integers, by name. */
  readonly numbers?: Readonly<Record<string, number>>;
  /** Attributes that are lists of integers, by name. */
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
  /** Name and version of the program that wrote the file; may be empty. */
  readonly producer: string;
  readonly graphName: string;
  /** Version of the operator set of each domain; the domain of ONNX itself is `ai.onnx`. */
  readonly opsets: ReadonlyMap<string, number>;
  /** Values of `metadata_props`, by key. */
  readonly metadata: ReadonlyMap<string, string>;
  /** Inputs that a caller must provide. Initializers, which have a default, are excluded. */
  readonly inputs: readonly OnnxTensor[];
  /**
   * Names of inputs that are also initializers. Their stored value is used, because ONNX Runtime Web does not accept
   * another.
   */
  readonly optionalInputs: readonly string[];
  readonly outputs: readonly OnnxTensor[];
  /**
   * Number of nodes of each operator, including those of subgraphs. Keys are `MatMul` in ONNX's own domain, and
   * `com.example:Name` in others.
   */
  readonly operators: ReadonlyMap<string, number>;
  /**
   * All nodes in the order of the file, including those of functions. Nodes of a subgraph precede the node that
   * contains it.
   */
  readonly nodes: readonly OnnxNode[];
  /** Tensors stored in the file, by name. */
  readonly stored: ReadonlyMap<string, OnnxValue>;
  /** Declared types and shapes of intermediate values, by name. */
  readonly values: ReadonlyMap<string, OnnxTensor>;
  /** Operators that the file itself defines, named as in {@link operators}. */
  readonly functions: ReadonlySet<string>;
  readonly externalFiles: readonly ExternalFile[];
  /** Number of bytes of weights in the file itself. */
  readonly initializerBytes: number;
}

/** Formats the type and shape of a tensor, for example `float32 [N, 13]`. */
export function describeTensor({ dtype, dims }: Pick<OnnxTensor, 'dtype' | 'dims'>): string {
  return `${dtype} ${dims ? `[${dims.map((dim) => dim ?? '?').join(', ')}]` : 'of unknown shape'}`;
}
