import type { Convolution, OnnxDtype, OnnxHeader } from './header.js';

/**
 * Convolutions that ONNX Runtime's WebGPU provider computes wrongly, without a word (onnxruntime-web 1.30.0, and onnxruntime-webgpu 1.27.0 before
 * it; tests/generator/browser/provider.test.ts tries whether it still does): of 6, 9, 15, 18 ... channels, a multiple of 3 that is none of 4, to a multiple of 4, by a
 * kernel of more than one pixel.
 */
export function miscomputedConvolutions({ convolutions }: OnnxHeader): Convolution[] {
  return convolutions.filter(
    ({ inputs, outputs, kernel }) =>
      inputs > 3 && inputs % 3 === 0 && inputs % 4 !== 0 && outputs % 4 === 0 && Math.max(...kernel) > 1,
  );
}

/** Types that no cast of onnxruntime-web's builds with WebGPU (1.30.0, JSPI and Asyncify) reads or writes, on the CPU either: no session can be made. */
const UNCASTABLE: readonly OnnxDtype[] = ['uint16', 'int16', 'float64'];

/** Types among a file's casts that pages cannot cast. */
export const uncastableTypes = ({ casts }: OnnxHeader): OnnxDtype[] => UNCASTABLE.filter((dtype) => casts.has(dtype));

/** Operators of ONNX itself that have a WebGPU kernel for float32, or none to need; measured with onnxruntime-webgpu 1.27.0, as packages/exporter has them. */
const KERNELS = new Set(
  `Abs Acos Acosh Add And ArgMax ArgMin Asin Asinh Atan Atanh AveragePool BatchNormalization Cast Ceil Clip Concat Constant Conv ConvTranspose Cos Cosh
  CumSum DepthToSpace Div Einsum Elu Equal Erf Exp Expand Flatten Floor Gather GatherElements GatherND Gelu Gemm GlobalAveragePool GlobalMaxPool Greater
  GreaterOrEqual GridSample HardSigmoid HardSwish Identity InstanceNormalization LayerNormalization LeakyRelu Less LessOrEqual Log LpNormalization MatMul
  MaxPool Mul Neg Not Pad Pow RMSNormalization Range Reciprocal ReduceL1 ReduceL2 ReduceLogSum ReduceLogSumExp ReduceMax ReduceMean ReduceMin ReduceProd
  ReduceSum ReduceSumSquare Relu Reshape Resize ScatterElements ScatterND Shape Sigmoid Sin Sinh Slice Softmax Softplus Split Sqrt Squeeze Sub Tan Tanh
  ThresholdedRelu Tile TopK Transpose Unsqueeze Where`.split(/\s+/),
);

/** What to write instead of operators that people use in generators. */
const INSTEAD: Readonly<Record<string, string>> = {
  Compress: 'keep every row and write opacity 0 into the dead ones',
  NonZero: 'keep every row and write opacity 0 into the dead ones',
  Round: 'write Floor(x + 0.5)',
  Min: 'write Where or Clip',
  Max: 'write Where, Relu or Clip',
  Det: 'write the determinant out in Mul and Sub',
};

/** A `Split` binds a buffer for its input and one for each output; adapters have 10 for a shader, some of them. */
const MOST_SPLIT_OUTPUTS = 9;
/** The first opset whose GridSample has no kernel. */
const GRID_SAMPLE_OPSET = 20;

/** One thing that takes work from the GPU, or the whole model: sentences for people, without a full stop. */
export function gpuNotes(header: OnnxHeader): string[] {
  const { operators, functions, opsets, widestSplit, inputs, outputs } = header;
  const notes = [...operators.keys()]
    .filter((name) => !KERNELS.has(name) && !name.includes(':') && !functions.has(name))
    .map((name) => {
      const remedy = INSTEAD[name] ?? 'write it in other operators';
      return `WebGPU has no kernel for ${name}: unless all that it takes is constant, every run waits for the GPU in its midst; ${remedy}`;
    });
  if (operators.has('GridSample') && (opsets.get('ai.onnx') ?? 0) >= GRID_SAMPLE_OPSET) {
    notes.push(
      'WebGPU has kernels for GridSample up to opset 19: every run waits for the GPU in its midst; export opset 17',
    );
  }
  if (widestSplit > MOST_SPLIT_OUTPUTS) {
    notes.push(
      `a Split into ${widestSplit} binds more buffers than a shader may, and the whole model runs on the CPU; split into ${MOST_SPLIT_OUTPUTS} at most, or use Gather`,
    );
  }
  for (const { inputs: from, outputs: to } of miscomputedConvolutions(header)) {
    notes.push(
      `WebGPU computes its convolution of ${from} channels to ${to} wrongly, so the whole model runs there: pad the channels going in to a multiple of 4`,
    );
  }
  if ([...inputs, ...outputs].some(({ dtype }) => dtype === 'float16')) {
    notes.push(
      'float16 tensors need the device feature shader-f16: without it, as in Chromium on Linux with NVIDIA, the whole model runs there; offer a float32 file, too',
    );
  }
  return notes;
}
