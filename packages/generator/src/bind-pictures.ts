import {
  describeTensor,
  GaussianSplatError,
  type Contract,
  type OnnxHeader,
  type OnnxTensor,
} from '@gaussian-splat/core';
import { elementsOf, type GpuTensor } from './input-value.js';
import type { GeneratorState } from './state.js';

/**
 * Pictures for the inputs with the role `image`.
 * @param given inputs that a model before this one writes, and that the state need not have.
 * @throws GaussianSplatError `argument/value` for a picture that is missing, or of another size or element type than the input.
 */
export function bindPictures(
  header: OnnxHeader,
  contract: Contract,
  state: GeneratorState,
  given: ReadonlySet<string>,
): Record<string, GpuTensor> {
  const pictures: Record<string, GpuTensor> = {};
  for (const input of header.inputs) {
    if (contract.inputs[input.name].role !== 'image' || given.has(input.name)) continue;
    const picture = state.pictures?.[input.name];
    if (picture === undefined) throw missing(input);
    if (!fits(picture, input)) throw misfit(picture, input);
    // As it is now: whoever owns it may change it.
    const { buffer, dtype, dims, version } = picture;
    pictures[input.name] = { buffer, dtype, dims, version };
  }
  return pictures;
}

function fits({ buffer, dtype, dims }: GpuTensor, input: OnnxTensor): boolean {
  const bytes = elementsOf(dims) * (dtype === 'float16' ? 2 : 4);
  const sizes = input.dims ?? [];
  return (
    dtype === input.dtype &&
    dims.length === sizes.length &&
    sizes.every((size, i) => typeof size !== 'number' || size === dims[i]) &&
    buffer.size >= Math.ceil(bytes / 4) * 4
  );
}

const missing = (input: OnnxTensor): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `input ${input.name} (image)`,
    expected: `a picture for ${describeTensor(input)}`,
    found: 'none',
    remedy: `give one: control-${input.name.toLowerCase()}="photo.jpg" on the element, or pictures in the state of the generator`,
  });

const misfit = ({ buffer, dtype, dims }: GpuTensor, input: OnnxTensor): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `input ${input.name} (image)`,
    expected: describeTensor(input),
    found: `${dtype} [${dims.join(', ')}] in a buffer of ${buffer.size} bytes`,
    remedy: 'make the picture in the size and element type of the input',
  });
