import { shOrderOf, type Contract, type InputBinding, type OutputBinding } from '@gaussian-splat/core/contract';
import type { OnnxHeader, OnnxTensor } from '@gaussian-splat/core/onnx';

/** A draft of a contract that is consistent with the names and shapes of a file, and questions for its author. */
export interface Draft {
  readonly contract: Contract;
  readonly questions: readonly string[];
}

/**
 * For each attribute, the pattern of its output's name, and the row lengths that identify an output whose name does not
 * match.
 */
const NAMES: Readonly<Record<string, { readonly pattern: RegExp; readonly columns: readonly number[] }>> = {
  positions: { pattern: /pos|xyz|mean|cent/i, columns: [3] },
  covariances: { pattern: /cov/i, columns: [6, 9] },
  scales: { pattern: /scal|sigma|size/i, columns: [3, 1] },
  rotations: { pattern: /rot|quat/i, columns: [4] },
  sh: { pattern: /sh\b|sh_|harmonic|feature/i, columns: [12, 27, 48] },
  colors: { pattern: /col|rgb|sh0/i, columns: [3, 4] },
  opacities: { pattern: /opac|alpha/i, columns: [1] },
};

/** Row length of an output with positions, opacity, scales, a quaternion and plain colors, as in LGM. */
const LGM_COLUMNS = 14;

/**
 * Drafts the missing contract of a file from the names and shapes of its inputs and outputs. Properties that no header
 * contains (units, activations, ranges) get common defaults, and a question to the author.
 */
export function draftContract(header: OnnxHeader): Draft {
  const questions: string[] = [];
  const inputs: Record<string, InputBinding> = {};
  const roles = new Set<string>();
  for (const input of header.inputs) {
    const binding = draftInput(input, questions);
    const isTaken = roles.has(binding.role) && !REPEATABLE.has(binding.role);
    inputs[input.name] = isTaken ? draftControl(input, questions) : binding;
    roles.add(binding.role);
  }
  const outputs = draftOutputs(header, questions);
  const isOpen = header.outputs.some(({ dims }) => dims?.some((dim) => typeof dim !== 'number'));
  if (isOpen && outputs.layout !== 'image') questions.push('nMax: the maximum number of Gaussians of one run');
  const name = header.name
    .split(/[/\\]/)
    .at(-1)!
    .replace(/\.onnx$/i, '');
  return { contract: { version: 1, name, inputs, outputs, ...(isOpen ? { nMax: 100_000 } : {}) }, questions };
}

/** Roles that a contract may give to several inputs. */
const REPEATABLE: ReadonlySet<string> = new Set(
  'control image state view camera_to_world intrinsics projection view_projection'.split(' '),
);

function draftInput(input: OnnxTensor, questions: string[]): InputBinding {
  const { name, dims, dtype } = input;
  const sizes = (dims ?? []).filter((dim, i) => !(dim === 1 && i < (dims?.length ?? 0) - 1));
  const shape = sizes.join(',');
  const is = (pattern: RegExp): boolean => pattern.test(name);
  if (shape === '4,4') {
    if (is(/view.?proj|mvp/i)) return { role: 'view_projection', order: 'row-major' };
    if (is(/proj/i)) return { role: 'projection', order: 'row-major', axes: 'RDF' };
    if (is(/c2w|to_?world|cam(era)?_?pose/i)) {
      questions.push(`input ${name}: camera to world, row-major, axes RDF (OpenCV)? RUB is OpenGL's`);
      return { role: 'camera_to_world', order: 'row-major', axes: 'RDF' };
    }
    questions.push(`input ${name}: world to camera, row-major, axes RDF (OpenCV)? RUB is OpenGL's`);
    return { role: 'view', order: 'row-major', axes: 'RDF' };
  }
  if ((shape === '3,3' || shape === '4') && is(/^k$|intrin/i)) {
    questions.push(`input ${name}: in pixels, or as fractions of the image's width and height ("normalized")?`);
    return { role: 'intrinsics', unit: 'pixels' };
  }
  if (shape === '3' && is(/cam|eye|origin/i)) return { role: 'camera_position' };
  if (shape === '2' && is(/viewport|resolution|size/i)) return { role: 'viewport' };
  if (dims?.length === 4 && is(/im(age|g)|picture|frame/i)) return { role: 'image' };
  const isOne = shape === '1' || shape === '';
  if (isOne && is(/^t$|time/i) && dtype === 'float32') {
    questions.push(`input ${name}: seconds, or a fraction 0..1 ("normalized", with a duration)?`);
    return { role: 'time', unit: 'seconds' };
  }
  const isWhole = dtype === 'int32' || dtype === 'int64';
  if (isOne && isWhole && is(/frame/i)) return { role: 'frame' };
  if (isOne && isWhole && is(/seed/i)) return { role: 'seed' };
  if (is(/pose|joint|theta/i)) return draftPose(name, sizes, questions);
  if (is(/shape|beta/i) && sizes.length === 1) return { role: 'shape' };
  return draftControl(input, questions);
}

function draftControl({ name }: OnnxTensor, questions: string[]): InputBinding {
  questions.push(`input ${name}: a control from 0 to 1? Give its range, its default and a label`);
  return { role: 'control', range: [0, 1], default: 0, label: name };
}

function draftPose(name: string, sizes: readonly unknown[], questions: string[]): InputBinding {
  if (sizes.length === 2 && sizes[1] === 4) {
    questions.push(`input ${name}: quaternions w x y z?`);
    return { role: 'pose', format: 'quaternion', quaternionOrder: 'wxyz' };
  }
  if (sizes.length === 3 && sizes[1] === 3 && sizes[2] === 3) return { role: 'pose', format: 'matrix' };
  return { role: 'pose', format: sizes.length === 2 && sizes[1] === 3 ? 'axis-angle' : 'parameters' };
}

function draftOutputs({ outputs }: OnnxHeader, questions: string[]): OutputBinding {
  const columns = ({ dims }: OnnxTensor): number => Number(dims?.at(-1) ?? 0);
  const [only] = outputs;
  if (outputs.length === 1 && only.dims?.length === 4) return { layout: 'image', image: only.name };
  const count = outputs.find(({ name, dtype }) => /count|num/i.test(name) && /^int/.test(dtype));
  const counted = count ? { count: count.name } : {};
  const packed = outputs.find((output) => [13, 22, 37, 58].includes(columns(output)));
  if (packed) {
    questions.push(`output ${packed.name}: position 3, covariance 6, color, opacity 0..1, in this order?`);
    const color =
      columns(packed) === 13 ? ({ color: 'rgb' } as const) : ({ color: 'sh', shOrder: 'coefficient-major' } as const);
    return { layout: 'packed', gaussians: packed.name, ...color, opacityActivation: 'linear', ...counted };
  }
  const row = outputs.find((output) => columns(output) === LGM_COLUMNS);
  if (row) {
    questions.push(
      `output ${row.name}: position 3, opacity 0..1, scale 3, rotation w x y z, color 3, as LGM has them?`,
    );
    return {
      layout: 'packed',
      gaussians: row.name,
      columns: ['positions', 'opacities', 'scales', 'rotations', 'colors'],
      ...{ color: 'rgb', opacityActivation: 'linear', scaleActivation: 'linear', rotationOrder: 'wxyz' },
      ...counted,
    } as const;
  }
  const found: Record<string, string> = {};
  const free = outputs.filter((output) => output !== count);
  for (const byName of [true, false]) {
    for (const [attribute, { pattern, columns: sizes }] of Object.entries(NAMES)) {
      const at = free.findIndex((output) => (byName ? pattern.test(output.name) : sizes.includes(columns(output))));
      if (attribute in found || at < 0) continue;
      found[attribute] = free[at].name;
      if (!byName) questions.push(`output ${free[at].name}: is it the ${attribute}?`);
      free.splice(at, 1);
    }
  }
  if (found.sh) delete found.colors;
  if (found.covariances) ['scales', 'rotations'].forEach((name) => delete found[name]);
  questions.push('opacityActivation: "linear" for 0..1, "logit" for numbers before the sigmoid?');
  if (found.scales)
    questions.push(
      'scaleActivation: "linear" for standard deviations, "log" for their logarithms? rotationOrder: wxyz or xyzw?',
    );
  return {
    layout: 'split',
    positions: 'positions',
    opacities: 'opacities',
    ...found,
    ...(found.scales ? { scaleActivation: 'linear', rotationOrder: 'wxyz' } : {}),
    ...(found.sh ? { shOrder: shOrderOf(outputs.find(({ name }) => name === found.sh)!) } : {}),
    opacityActivation: 'linear',
    ...counted,
  };
}
