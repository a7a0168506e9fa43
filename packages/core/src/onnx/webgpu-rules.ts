/**
 * What ONNX Runtime's WebGPU provider can and cannot do, as data: the rules of this checker and of the Python exporter's, which has a copy
 * (`node scripts/write-webgpu-rules.mjs`). Measured operator by operator with onnxruntime-webgpu 1.27.0 and onnxruntime-web 1.30.0.
 */
export const WEBGPU_RULES = {
  /** Operators of ONNX itself that have a kernel for float32, or none to need. */
  kernels:
    `Abs Acos Acosh Add And ArgMax ArgMin Asin Asinh Atan Atanh AveragePool BatchNormalization Cast Ceil Clip Concat Constant Conv ConvTranspose Cos
    Cosh CumSum DepthToSpace Div Einsum Elu Equal Erf Exp Expand Flatten Floor Gather GatherElements GatherND Gelu Gemm GlobalAveragePool
    GlobalMaxPool Greater GreaterOrEqual GridSample HardSigmoid HardSwish Identity InstanceNormalization LayerNormalization LeakyRelu Less
    LessOrEqual Log LpNormalization MatMul MaxPool Mul Neg Not Pad Pow RMSNormalization Range Reciprocal ReduceL1 ReduceL2 ReduceLogSum
    ReduceLogSumExp ReduceMax ReduceMean ReduceMin ReduceProd ReduceSum ReduceSumSquare Relu Reshape Resize ScatterElements ScatterND Shape
    Sigmoid Sin Sinh Slice Softmax Softplus Split Sqrt Squeeze Sub Tan Tanh ThresholdedRelu Tile TopK Transpose Trilu Unsqueeze Where`.split(
      /\s+/,
    ),
  /** What to write instead of operators that people use in generators. */
  instead: {
    Compress: 'keep every row and write opacity 0 into the dead ones',
    NonZero: 'keep every row and write opacity 0 into the dead ones',
    Round: 'Floor(x + 0.5), or compare with a shifted number',
    Sign: 'Where(x > 0, 1, -1)',
    Min: 'Where(a < b, a, b), or Clip',
    Max: 'Where(a > b, a, b), Relu or Clip',
    Or: 'add masks as floats',
    Sum: 'Add',
    Mean: 'Add and Mul',
    PRelu: 'LeakyRelu, or Where',
    LogSoftmax: 'Log(Softmax(x))',
    SpaceToDepth: 'Reshape and Transpose',
    Det: 'write the determinant out in Mul and Sub',
  } as Readonly<Record<string, string>>,
  /** Operators of com.microsoft that have a kernel. */
  contrib: ['MultiHeadAttention', 'SkipLayerNormalization', 'SkipSimplifiedLayerNormalization'],
  /** Operators whose kernel computes other numbers than the CPU does. */
  miscomputed: {
    MultiHeadAttention: 'WebGPU computes it wrongly for more than one query, so the whole model runs on the CPU',
  } as Readonly<Record<string, string>>,
  /** Operators that compute a variance as the mean of squares less the square of the mean. */
  inexact: ['InstanceNormalization', 'LayerNormalization', 'SkipLayerNormalization'],
  controlFlow: ['If', 'Loop', 'Scan'],
  /** Their results are another shape of what they take: no kernel writes an output that one of them makes. */
  aliases: ['Reshape', 'Squeeze', 'Unsqueeze', 'Flatten', 'Identity'],
  /** 64-bit integers may come into these without a kernel for them: {@link makers} of some, and as indices. */
  makers: ['Cast', 'ArgMax', 'ArgMin', 'TopK', 'Shape'],
  indexed: ['Gather', 'GatherElements', 'GatherND', 'ScatterND', 'ScatterElements'],
  newestOpset: 26,
  newestIr: 13,
  /** The last opset whose GridSample has a kernel. */
  gridSampleOpset: 19,
  /** A Split binds a buffer for its input and one for each output; some adapters have 10 for a shader. */
  mostSplitOutputs: 9,
  /** CumSum lets each thread add up its whole prefix. */
  longestCumSum: 4096,
  /** What opset to export for which everything above is right. */
  exportOpset: 18,
} as const;
