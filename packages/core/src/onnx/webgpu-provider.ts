import { GraphValues } from './graph-values.js';
import type { OnnxDtype, OnnxHeader, OnnxNode } from './header.js';
import { WEBGPU_RULES as RULES } from './webgpu-rules.js';

/**
 * Element types that Cast does not support in onnxruntime-web's builds with WebGPU (1.30.0, JSPI and Asyncify), not even
 * on the CPU. No session can be created for a model with such a Cast.
 */
const UNCASTABLE: readonly OnnxDtype[] = ['uint16', 'int16', 'float64'];

/**
 * A reason that part of a file will not stay on the GPU (`fallback`), fail there (`failure`), compute wrong numbers
 * there (`wrong`), lose precision there for some inputs (`inexact`), or be slow.
 */
export interface GpuFinding {
  readonly kind: 'fallback' | 'failure' | 'wrong' | 'inexact' | 'slow';
  /** The operator; `file`, `shape` or `type` if there is none. */
  readonly operator: string;
  /** The first output of the node, or the affected tensor. */
  readonly tensor: string;
  readonly reason: string;
  readonly remedy: string;
}

/** A convolution whose weights have a known shape. */
interface Convolution {
  readonly inputs: number;
  readonly outputs: number;
  readonly kernel: readonly number[];
  readonly strides: readonly number[];
  readonly group: number;
}

/** Returns the element types of a file's casts that browsers cannot cast, and bfloat16 if any tensor has it. */
export function uncastableTypes(header: OnnxHeader): OnnxDtype[] {
  const values = new GraphValues(header);
  const used = new Set<OnnxDtype | undefined>();
  for (const { operator, inputs, outputs } of header.nodes) {
    if (operator !== 'Cast') continue;
    used.add(values.dtypeOf(inputs[0])).add(values.dtypeOf(outputs[0]));
  }
  return [...UNCASTABLE.filter((dtype) => used.has(dtype)), ...(values.has('bfloat16') ? (['bfloat16'] as const) : [])];
}

/**
 * Returns the nodes that ONNX Runtime's WebGPU provider computes wrongly without an error, for all inputs
 * (onnxruntime-web 1.30.0; tests/generator/browser/placement.test.ts verifies the faults). Outputs on the GPU are compared
 * with those on the CPU in any case, but later, and not those of large models.
 */
export function miscomputedNodes(header: OnnxHeader): GpuFinding[] {
  const values = new GraphValues(header);
  return header.nodes.flatMap((node) => miscomputed(node, values) ?? []);
}

function miscomputed(node: OnnxNode, values: GraphValues): GpuFinding | undefined {
  if (node.operator === 'Conv') {
    const convolution = convolutionOf(node, values);
    if (convolution === undefined || !isMiscomputed(convolution)) return undefined;
    const reason = `WebGPU computes ${convolution.inputs} channels to ${convolution.outputs} wrongly, so the whole model runs on the CPU`;
    return of('wrong', node, reason, 'pad the channels going in to a multiple of 4');
  }
  const isBlocked = node.operator === 'DequantizeLinear' && (node.numbers?.block_size ?? 0) > 0;
  if (!isBlocked || values.dimsOf(node.inputs[0])?.length !== 1) return undefined;
  const reason = 'WebGPU computes blocks of one dimension wrongly, so the whole model runs on the CPU';
  return of('wrong', node, reason, 'quantize a matrix of one row, and reshape it');
}

/**
 * Whether the provider computes a convolution wrongly: it has one or two dimensions, one group, and a kernel or stride
 * above 1; its input channels are a multiple of 3 above 3 but not of 4, and its output channels a multiple of 4.
 */
function isMiscomputed({ inputs, outputs, kernel, strides, group }: Convolution): boolean {
  const isPointwise = [...kernel, ...strides].every((size) => size === 1);
  const isPlane = kernel.length === 1 || kernel.length === 2;
  return (
    group === 1 && isPlane && inputs > 3 && inputs % 3 === 0 && inputs % 4 !== 0 && outputs % 4 === 0 && !isPointwise
  );
}

function convolutionOf(
  { inputs: [, weights], numbers, lists }: OnnxNode,
  values: GraphValues,
): Convolution | undefined {
  const [outputs, perGroup, ...kernel] = values.dimsOf(weights) ?? [];
  if (typeof outputs !== 'number' || typeof perGroup !== 'number' || kernel.includes(null)) return undefined;
  const group = numbers?.group ?? 1;
  const sizes = lists?.kernel_shape ?? (kernel as number[]);
  return { inputs: perGroup * group, outputs, kernel: sizes, strides: lists?.strides ?? sizes.map(() => 1), group };
}

/**
 * Returns the outputs of the products that ONNX Runtime's optimizer fuses wrongly (onnxruntime 1.30 and 1.31, CPU). A
 * transposed matrix times a vector, as in a camera position, loses its transposition in the fusion. Sessions of files
 * with such products are created without fusions.
 */
export function misfusedProducts(header: OnnxHeader): string[] {
  const values = new GraphValues(header);
  return header.nodes.filter((node) => isMisfused(node, values)).map(({ outputs }) => outputs[0]);
}

const isMisfused = ({ operator, inputs }: OnnxNode, values: GraphValues): boolean =>
  operator === 'MatMul' &&
  values.makerOf(inputs[0])?.operator === 'Transpose' &&
  !values.isConstant(inputs[0]) &&
  values.dimsOf(inputs[1])?.length === 1;

/** Returns the names of the outputs that are equal in every run, because they depend only on constants. */
export function constantOutputs(header: OnnxHeader): Set<string> {
  const values = new GraphValues(header);
  return new Set(header.outputs.map(({ name }) => name).filter((name) => values.isConstant(name)));
}

type Rule = (node: OnnxNode, opset: number, values: GraphValues, header: OnnxHeader) => Iterable<GpuFinding>;

/**
 * Returns the reasons that a file cannot run entirely on the GPU with graph capture; empty if it can. The exporter's
 * `gpu_findings` applies the same rules.
 */
export function gpuFindings(header: OnnxHeader): GpuFinding[] {
  const values = new GraphValues(header);
  const opset = header.opsets.get('ai.onnx') ?? 0;
  const found = [...ofFile(header, opset)];
  for (const node of header.nodes) {
    if (node.isInner) continue;
    // The runtime dequantizes constants in each run.
    const wrong = miscomputed(node, values);
    if (wrong) found.push(wrong);
    // Nodes that depend only on constants run once, when the session is created.
    if (values.isFolded(node)) continue;
    for (const rule of NODE_RULES) found.push(...rule(node, opset, values, header));
  }
  return [...found, ...ofCopies(header, values)];
}

/** Returns the findings of a file for display: sentences without a full stop, one for each kind, operator and reason. */
export function gpuNotes(header: OnnxHeader): string[] {
  const known = new Set<string>();
  return gpuFindings(header).flatMap(({ kind, operator, tensor, reason, remedy }) => {
    const isOfFile = ['file', 'shape', 'type'].includes(operator);
    const said = `${reason}; ${remedy}`;
    // One finding is enough for repeated uses of an operator.
    const key = `${kind}: ${isOfFile ? '' : operator} ${said}`;
    if (known.has(key)) return [];
    known.add(key);
    return [`${kind}: ${isOfFile ? '' : `${operator} (${tensor}): `}${said}`];
  });
}

/** Returns the axis of instances in the file's own contract, if any: its size is fixed when a session is created. */
function axisOfInstances({ metadata }: OnnxHeader): string | undefined {
  try {
    const contract = JSON.parse(metadata.get('gaussian_contract') ?? '{}') as { instances?: { axis?: string } };
    return contract.instances?.axis;
  } catch {
    return undefined;
  }
}

function* ofFile(header: OnnxHeader, opset: number): Iterable<GpuFinding> {
  const { irVersion, inputs, outputs } = header;
  const axis = axisOfInstances(header);
  const values = new GraphValues(header);
  if (values.has('bfloat16')) {
    const reason = 'the file has tensors of bfloat16, which pages neither store nor cast';
    yield { kind: 'failure', operator: 'bfloat16', tensor: '', reason, remedy: 'export it in float32: module.float()' };
  }
  if (opset > RULES.newestOpset || irVersion > RULES.newestIr) {
    const reason = `opset ${opset}, IR ${irVersion} are newer than ${RULES.newestOpset} and ${RULES.newestIr}`;
    yield { kind: 'failure', operator: 'file', tensor: '', reason, remedy: `export opset ${RULES.exportOpset}` };
  }
  for (const { name: tensor, dims, dtype } of [...inputs, ...outputs]) {
    if (!dims?.every((dim) => typeof dim === 'number' || (dim !== null && dim === axis))) {
      const reason = `${tensor} has a symbolic or unknown size, so the graph cannot be recorded`;
      yield { kind: 'fallback', operator: 'shape', tensor, reason, remedy: 'export fixed shapes' };
    }
    if (dtype === 'float16') {
      const reason = `${tensor} is float16, which needs the device feature shader-f16 (Chromium hides it on NVIDIA under Linux): without it the whole model runs on the CPU`;
      yield { kind: 'failure', operator: 'type', tensor, reason, remedy: 'offer a float32 file, too' };
    }
  }
}

/**
 * Finds outputs that are views of another tensor, so that no kernel writes them and a recording does not repeat their
 * copy. A file without inputs runs once and is not affected; constant outputs are read once.
 */
function* ofCopies({ inputs, outputs }: OnnxHeader, values: GraphValues): Iterable<GpuFinding> {
  for (const { name: tensor } of inputs.length > 0 ? outputs : []) {
    const operator = values.makerOf(tensor)?.operator ?? '';
    if (values.isConstant(tensor) || !(RULES.aliases as readonly string[]).includes(operator)) continue;
    const reason = `${tensor} is copied, which a recording of the commands does not repeat: it runs unrecorded`;
    yield {
      kind: 'slow',
      operator,
      tensor,
      reason,
      remedy: 'let a kernel write it: add a zero that comes from an input',
    };
  }
}

const of = (kind: GpuFinding['kind'], { operator, outputs }: OnnxNode, reason: string, remedy: string): GpuFinding => ({
  kind,
  operator: operator.slice(operator.lastIndexOf(':') + 1),
  tensor: outputs[0] ?? '',
  reason,
  remedy,
});

const NO_KERNEL = 'WebGPU has no kernel for it: every run is interrupted by a wait for the GPU';

const kernelRule: Rule = function* (node, opset, _, { functions }) {
  const { operator } = node;
  if (operator.includes(':')) {
    if (functions.has(operator)) return;
    const name = operator.replace(/^com\.microsoft:/, '');
    if ((RULES.contrib as readonly string[]).includes(name)) {
      const wrong = RULES.miscomputed[name];
      if (wrong) yield of('wrong', node, wrong, 'write it in operators of ai.onnx');
      return;
    }
    const domain = operator.slice(0, operator.lastIndexOf(':'));
    const remedy = 'write it in operators of ai.onnx';
    if (domain === 'com.microsoft') yield of('fallback', node, NO_KERNEL, remedy);
    else yield of('failure', node, `domain ${domain} is not part of ONNX`, remedy);
  } else if ((RULES.controlFlow as readonly string[]).includes(operator)) {
    yield of('fallback', node, 'control flow ends the recording', 'unroll it');
  } else if (!RULES.kernels.includes(operator)) {
    const remedy = RULES.instead[operator] ?? 'write it in other operators';
    yield of('fallback', node, NO_KERNEL, remedy);
  } else if (operator === 'GridSample' && opset > RULES.gridSampleOpset) {
    const reason = `WebGPU has kernels for it up to opset ${RULES.gridSampleOpset}: every run is interrupted by a wait for the GPU`;
    yield of('fallback', node, reason, `export opset ${RULES.exportOpset}`);
  }
};

const typeRule: Rule = function* (node, _, values) {
  const { operator, inputs, outputs } = node;
  const isWide = (name: string): boolean => ['int64', 'float64'].includes(values.dtypeOf(name) ?? '');
  let wide = [...inputs, ...outputs].filter((name) => name !== '' && !values.isConstant(name) && isWide(name));
  // Indices of Gather and similar operators may be int64, and a Cast may produce them; everything else is arithmetic.
  if ((RULES.makers as readonly string[]).includes(operator)) wide = wide.filter((name) => inputs.includes(name));
  else if ((RULES.indexed as readonly string[]).includes(operator)) {
    wide = wide.filter((name) => name === inputs[0] || name === outputs[0]);
  }
  if (wide.length === 0) return;
  const reason = `${wide[0]} is ${values.dtypeOf(wide[0])}, for which WebGPU has no kernels`;
  yield of('fallback', node, reason, 'compute in int32 and cast last, or bake the numbers');
};

const sizeRule: Rule = function* (node, _, values) {
  const { operator, inputs, outputs } = node;
  if (operator === 'Split' && outputs.length > RULES.maxSplitOutputs) {
    const reason = `a Split into ${outputs.length} binds more buffers than a shader may, and the whole model runs on the CPU`;
    yield of('failure', node, reason, `split into at most ${RULES.maxSplitOutputs}, or use Gather`);
  }
  if (isMisfused(node, values)) {
    const reason =
      "ONNX Runtime's optimizer loses the transposition of a matrix times a vector, so pages load the file without fusions";
    yield of('slow', node, reason, 'make the vector a matrix of one column: (R.T @ t[:, None])[:, 0]');
  }
  if (operator === 'CumSum') {
    const longest = Math.max(0, ...(values.dimsOf(inputs[0]) ?? []).map((size) => size ?? 0));
    if (longest > RULES.longestCumSum) {
      const reason = `over ${longest} elements it takes their square in steps`;
      yield of('slow', node, reason, 'leave compaction to the renderer');
    }
  }
};

const exactnessRule: Rule = function* (node, _, values) {
  const { operator, inputs, numbers } = node;
  if ((RULES.inexact as readonly string[]).includes(operator.replace(/^com\.microsoft:/, ''))) {
    const reason = 'its variance loses digits where the mean is 100 times the deviation or more';
    yield of('inexact', node, reason, 'subtract the mean first if its inputs have a large one');
  }
  if (operator === 'Resize' && numbers?.antialias) {
    const reason = 'WebGPU does not resize with antialias, so the whole model runs on the CPU';
    yield of('failure', node, reason, 'resize before, or without antialias');
  }
  const types = new Set(inputs.map((name) => values.dtypeOf(name)).filter((dtype) => dtype !== undefined));
  if (operator === 'Pow' && types.size > 1) {
    const reason = 'its exponent has another type than its base: it runs unrecorded';
    yield of('fallback', node, reason, 'write the exponent as a float, or multiply');
  }
};

const NODE_RULES: readonly Rule[] = [kernelRule, typeRule, sizeRule, exactnessRule];
