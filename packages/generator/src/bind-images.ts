import { GaussianSplatError } from '@gaussian-splat/core';
import type { Contract } from '@gaussian-splat/core/contract';
import { describeTensor, type OnnxHeader, type OnnxTensor } from '@gaussian-splat/core/onnx';
import { elementsOf, type GpuTensor } from './input-value.js';
import type { GeneratorState } from './state.js';

/**
 * Returns the tensors for the inputs with the roles `image` and `depth`, by input name.
 * @param given Names of inputs that a previous model writes, which the state may omit.
 * @throws GaussianSplatError `argument/value` for an image that is missing, or whose size or element type differs from
 * that of the input.
 */
export function bindImages(
  header: OnnxHeader,
  contract: Contract,
  state: GeneratorState,
  given: ReadonlySet<string>,
): Record<string, GpuTensor> {
  const images: Record<string, GpuTensor> = {};
  for (const input of header.inputs) {
    const { role } = contract.inputs[input.name];
    if ((role !== 'image' && role !== 'depth') || given.has(input.name)) continue;
    const image = role === 'depth' ? state.depth : state.images?.[input.name];
    if (image === undefined) throw missing(input, role);
    if (!fits(image, input)) throw misfit(image, input, role);
    // The properties are copied, because the owner of the image may modify them.
    const { buffer, dtype, dims, version } = image;
    images[input.name] = { buffer, dtype, dims: dimsFor(input, dims), version };
  }
  return images;
}

function fits({ buffer, dtype, dims }: GpuTensor, input: OnnxTensor): boolean {
  const bytes = elementsOf(dims) * (dtype === 'float16' ? 2 : 4);
  const sizes = dimsFor(input, dims);
  return (
    dtype === input.dtype &&
    elementsOf(sizes) === elementsOf(dims) &&
    sizes.slice(-2).every((size, i) => size === dims[dims.length - 2 + i]) &&
    buffer.size >= Math.ceil(bytes / 4) * 4
  );
}

/** Returns the dimensions of the input, including leading ones. Open sizes are those of the image. */
function dimsFor({ dims: sizes = [] }: OnnxTensor, dims: readonly number[]): number[] {
  const before = dims.length - sizes.length;
  return sizes.map((size, i) => (typeof size === 'number' ? size : dims[before + i]));
}

/** Numbers of planes: of a depth, of colors, and of colors with alpha. */
const CHANNELS = [1, 3, 4] as const;

/**
 * Returns the requirements of an input with the role `image` or `depth`: the number of planes and of images, and the
 * sizes in pixels that the file fixes; undefined for an open size.
 */
export function imageShapeOf({ dims = [], dtype }: OnnxTensor): {
  readonly width: number | undefined;
  readonly height: number | undefined;
  readonly dtype: 'float32' | 'float16';
  readonly channels: 1 | 3 | 4;
  readonly views: number;
} {
  const [height, width] = dims.slice(-2).map((size) => (typeof size === 'number' ? size : undefined));
  const views = dims.slice(0, -3).reduce<number>((product, size) => product * Number(size), 1);
  return {
    width,
    height,
    dtype: dtype as 'float32' | 'float16',
    channels: CHANNELS.find((channels) => channels === dims.at(-3)) ?? 3,
    views,
  };
}

const missing = (input: OnnxTensor, role: 'image' | 'depth'): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `input ${input.name} (${role})`,
    expected: `${role === 'depth' ? 'the depth of a frame' : 'an image'} for ${describeTensor(input)}`,
    found: 'none',
    remedy:
      role === 'depth'
        ? 'give one: depth in the state of the post-processor'
        : `give one: control-${input.name.toLowerCase()}="photo.jpg" on the element, or images in the state of the generator`,
  });

const misfit = ({ buffer, dtype, dims }: GpuTensor, input: OnnxTensor, role: string): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `input ${input.name} (${role})`,
    expected: describeTensor(input),
    found: `${dtype} [${dims.join(', ')}] in a buffer of ${buffer.size} bytes`,
    remedy: 'make the image in the size and element type of the input',
  });
