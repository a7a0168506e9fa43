/**
 * Capabilities of ONNX Runtime's WebGPU provider, for the rules of `gpuFindings` and of the Python exporter, which has a
 * copy (`node scripts/write-webgpu-rules.mjs`). Each operator was tested with the runtime of pages, onnxruntime-web 1.30.0:
 * tests/generator/browser/placement.test.ts.
 */
export const WEBGPU_RULES = {
  /** Operators of ONNX's own domain that have a kernel for float32, or need none. */
  kernels:
    `Abs Acos Acosh Add And ArgMax ArgMin Asin Asinh Atan Atanh AveragePool BatchNormalization Cast CastLike Ceil Clip Concat Constant ConstantOfShape Conv ConvTranspose Cos
    Cosh CumSum DepthToSpace DequantizeLinear Div Einsum Elu Equal Erf Exp Expand Flatten Floor Gather GatherElements GatherND Gelu Gemm GlobalAveragePool
    GlobalMaxPool Greater GreaterOrEqual GridSample HardSigmoid HardSwish Identity InstanceNormalization LayerNormalization LeakyRelu Less
    LessOrEqual Log LpNormalization MatMul Max MaxPool Min Mish Mul Neg Not PRelu Pad Pow RMSNormalization Range Reciprocal ReduceL1 ReduceL2 ReduceLogSum
    ReduceLogSumExp ReduceMax ReduceMean ReduceMin ReduceProd ReduceSum ReduceSumSquare Relu Reshape Resize ScatterElements ScatterND Shape
    Sigmoid Sin Sinh Slice Softmax Softplus Split Sqrt Squeeze Sub Swish Tan Tanh ThresholdedRelu Tile TopK Transpose Trilu Unsqueeze Where`.split(
      /\s+/,
    ),
  /** Replacements of operators without a kernel that are common in generators. */
  instead: {
    Compress: 'keep every row and write opacity 0 into the unused ones',
    NonZero: 'keep every row and write opacity 0 into the unused ones',
    Round: 'Floor(x + 0.5), or compare with a shifted number',
    Sign: 'Where(x > 0, 1, -1)',
    Or: 'add masks as floats',
    Sum: 'Add',
    Mean: 'Add and Mul',
    LogSoftmax: 'Log(Softmax(x))',
    SpaceToDepth: 'Reshape and Transpose',
    Det: 'write the determinant out in Mul and Sub',
  } as Readonly<Record<string, string>>,
  /** Operators of com.microsoft that have a kernel. */
  contrib:
    `Attention BiasAdd BiasGelu FastGelu FusedConv GatherBlockQuantized Gelu MatMulNBits MultiHeadAttention QuickGelu RotaryEmbedding
    SkipLayerNormalization SkipSimplifiedLayerNormalization`.split(/\s+/),
  /** Operators whose kernel computes other numbers than the CPU. */
  miscomputed: {
    MultiHeadAttention: 'WebGPU computes it wrongly for more than one query, so the whole model runs on the CPU',
  } as Readonly<Record<string, string>>,
  /** Operators that compute a variance as the mean of squares minus the square of the mean. */
  inexact: ['InstanceNormalization', 'LayerNormalization', 'SkipLayerNormalization'],
  controlFlow: ['If', 'Loop', 'Scan'],
  /** Operators whose outputs are views of their input, so that no kernel writes them. */
  aliases: ['Reshape', 'Squeeze', 'Unsqueeze', 'Flatten', 'Identity'],
  /** Operators that may produce 64-bit integers, although WebGPU has no kernels for them. */
  makers: ['Cast', 'ArgMax', 'ArgMin', 'TopK', 'Shape'],
  /** Operators that accept 64-bit integers as indices. */
  indexed: ['Gather', 'GatherElements', 'GatherND', 'ScatterND', 'ScatterElements'],
  newestOpset: 26,
  newestIr: 13,
  /** The last opset whose GridSample has a kernel. */
  gridSampleOpset: 19,
  /** Maximum outputs of a Split: it binds one buffer for each and one for its input; some adapters allow 10 in a shader. */
  maxSplitOutputs: 9,
  /** Maximum elements of a CumSum, whose kernel takes quadratic time: each thread sums its whole prefix. */
  longestCumSum: 4096,
  /** Opset for the export that satisfies all rules above. */
  exportOpset: 18,
} as const;
