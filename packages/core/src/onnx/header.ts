/** Element types of ONNX tensors, in the order of their numbers in the format; `undefined` where a file says none. */
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

/** Element type of a tensor, or what an input or output is if it is none. */
export type OnnxDtype =
  (typeof ONNX_DTYPES)[number] | 'sequence' | 'map' | 'optional' | 'sparse tensor' | 'opaque' | 'unknown';

/** A dimension: a number, a symbol that the file names, or null where the file says nothing. */
export type OnnxDim = number | string | null;

/** An input or output of the graph. */
export interface OnnxTensor {
  readonly name: string;
  readonly dtype: OnnxDtype;
  /** Undefined where the file does not even tell the rank. */
  readonly dims: readonly OnnxDim[] | undefined;
}

/** A file beside the model that holds some of its weights. */
export interface ExternalFile {
  /** Path relative to the model's folder, as the model writes it. */
  readonly location: string;
  /** Bytes that the file must have at least; 0 where the model does not say. */
  readonly byteLength: number;
}

/** A tensor that lies in the file: its type and shape, and its numbers where it is the shape of another. */
export interface OnnxValue {
  readonly dtype: OnnxDtype;
  readonly dims: readonly number[];
  /** Of short vectors of int64. */
  readonly integers?: readonly number[];
}

/** A node of the graph, without its weights. */
export interface OnnxNode {
  readonly name: string;
  /** As in {@link OnnxHeader.operators}. */
  readonly operator: string;
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
  /** True within a subgraph or a function. */
  readonly isInner: boolean;
  /** Attributes that are whole numbers, and lists of some. */
  readonly numbers?: Readonly<Record<string, number>>;
  readonly lists?: Readonly<Record<string, readonly number[]>>;
  /** Tensor of the attribute `value`, as `Constant` has it. */
  readonly value?: OnnxValue;
}

/** What an ONNX file says about itself, without its weights. */
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
  /** Inputs that a caller must give: those that are initializers, too, have a default and are left out. */
  readonly inputs: readonly OnnxTensor[];
  /** Names of inputs that are initializers, too: what the file gives them counts, for ONNX Runtime in a page takes no other. */
  readonly optionalInputs: readonly string[];
  readonly outputs: readonly OnnxTensor[];
  /** How often each operator occurs, subgraphs included: `MatMul`, or `com.example:Name` outside ONNX's own domain. */
  readonly operators: ReadonlyMap<string, number>;
  /** All nodes in the file's order, those of subgraphs and functions before the node that holds them. */
  readonly nodes: readonly OnnxNode[];
  /** Tensors that lie in the file, by name. */
  readonly stored: ReadonlyMap<string, OnnxValue>;
  /** What the file says of results between its nodes. */
  readonly values: ReadonlyMap<string, OnnxTensor>;
  /** Operators that the file itself defines, named as in {@link operators}. */
  readonly functions: ReadonlySet<string>;
  readonly externalFiles: readonly ExternalFile[];
  /** Bytes of weights within the file. */
  readonly initializerBytes: number;
}

/** A tensor's type and shape for readers: `float32 [N, 13]`. */
export function describeTensor({ dtype, dims }: Pick<OnnxTensor, 'dtype' | 'dims'>): string {
  return `${dtype} ${dims ? `[${dims.map((dim) => dim ?? '?').join(', ')}]` : 'of unknown shape'}`;
}
