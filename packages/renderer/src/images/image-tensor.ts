import { GaussianSplatError } from '@gaussian-splat/core';
import { imageToTensor } from '../generated/live-shaders.js';
import * as layouts from '../generated/live-layouts.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, kernelOf, TEXTURE_USAGE, type ComputeKernel } from '../gpu/kernel.js';
import { BufferOwner, GpuMemory } from '../gpu/memory.js';
import { submitPass, writeUniform } from '../gpu/one-off.js';

/** Size and element type of a tensor [views, channels, height, width]. */
export interface ImageShape {
  readonly width: number;
  readonly height: number;
  readonly dtype: 'float32' | 'float16';
  /** Number of channels: 3 for colors, 4 with alpha, 1 for depth, which is copied from the nearest texel. Default 3. */
  readonly channels?: 1 | 3 | 4;
  /** Number of images in the tensor. Default 1. */
  readonly views?: number;
}

/**
 * Fit of an image of another size: `stretch` uses the whole image, `cover` the largest central region with the
 * proportions of the tensor.
 */
export type ImageFit = 'stretch' | 'cover';

/**
 * Images as a tensor [views, channels, height, width] on the GPU, by default one image with three channels. The
 * channels are planes of red, green and blue in 0..1, sRGB-encoded, top row first, over black if the image is
 * transparent. Images of another size are resampled bilinearly, with antialiasing when they shrink.
 */
export class ImageTensor extends BufferOwner {
  readonly shape: ImageShape;
  readonly dtype: ImageShape['dtype'];
  /** [views, channels, height, width] */
  readonly dims: readonly [number, 1 | 3 | 4, number, number];
  /** Elements of the tensor; a word contains two float16. */
  readonly buffer: GPUBuffer;
  readonly #device: GPUDevice;
  readonly #kernel: ComputeKernel<typeof imageToTensor>;
  readonly #uniform: GPUBuffer;
  /** Number of words of one image. */
  readonly #words: number;
  readonly #bindings = new WeakMap<GPUTexture, GPUBindGroup>();
  #version = 0;

  /**
   * @throws GaussianSplatError `out-of-memory/buffer-limit` for a size that the device does not allow; `argument/value`
   * for several float16 images with an odd number of elements each.
   */
  constructor(device: GPUDevice, shape: ImageShape) {
    const { width, height, dtype, channels = 3, views = 1 } = shape;
    super(new GpuMemory(device));
    this.shape = shape;
    this.dtype = dtype;
    this.dims = [views, channels, height, width];
    this.#words = (channels * width * height) / (dtype === 'float16' ? 2 : 1);
    if (views > 1 && !Number.isInteger(this.#words)) throw oddHalves(width, height);
    this.#device = device;
    this.#kernel = kernelOf(device, imageToTensor);
    const { storage, uniform, copySource, copyDestination } = BUFFER_USAGE;
    // The size is a multiple of 16 bytes, because ONNX Runtime does not copy smaller units.
    const size = Math.ceil((4 * views * this.#words) / 16) * 16;
    this.buffer = this.memory.buffer('gs.picture.tensor', size, storage | copySource | copyDestination);
    const usage = uniform | copyDestination;
    this.#uniform = this.memory.buffer('gs.picture.uniform', layouts.ImageToTensor.size, usage);
  }

  /** Number of images written since the creation of the tensor. */
  get version(): number {
    return this.#version;
  }

  /**
   * Writes an image from a texture with the usage TEXTURE_BINDING. Encodes and submits one compute pass; nothing is
   * read back. Colors of textures with alpha must be premultiplied.
   * @param view Index of the image in the tensor, from 0.
   * @param part Size in pixels of the image in the texture, from the upper left corner; default: the whole texture.
   */
  write(
    texture: GPUTexture,
    fit: ImageFit = 'stretch',
    view = 0,
    part: { readonly width: number; readonly height: number } = texture,
  ): void {
    this.#writeUniform(part.width, part.height, fit, view);
    let bindings = this.#bindings.get(texture);
    if (bindings === undefined) {
      bindings = this.#kernel.bind({ image: this.#uniform, source: texture.createView(), tensor: this.buffer });
      this.#bindings.set(texture, bindings);
    }
    const groups = Math.ceil(this.#words / constants.IMAGE_GROUP);
    submitPass(this.#device, 'gs.picture', (pass) => this.#kernel.dispatch(pass, bindings, groups));
    this.#version++;
  }

  /**
   * Writes an image source of the browser (an ImageBitmap, an image, a canvas, or a video frame) without a read-back.
   * @throws GaussianSplatError `argument/value` for an image without pixels, or larger than the textures of the device.
   */
  upload(source: GPUCopyExternalImageSource, fit: ImageFit = 'cover', view = 0): void {
    const { width, height } = sizeOf(source);
    const max = this.#device.limits.maxTextureDimension2D;
    if (!(width > 0 && height > 0 && width <= max && height <= max)) throw wrongSize(width, height, max);
    const { copyDestination, textureBinding, renderAttachment } = TEXTURE_USAGE;
    const texture = this.#device.createTexture({
      label: 'gs.picture',
      size: [width, height],
      format: 'rgba8unorm',
      usage: copyDestination | textureBinding | renderAttachment,
    });
    this.#device.queue.copyExternalImageToTexture({ source }, { texture, premultipliedAlpha: true }, [width, height]);
    this.write(texture, fit, view);
    // The submitted commands keep the texture alive until they are executed.
    texture.destroy();
  }

  #writeUniform(width: number, height: number, fit: ImageFit, view: number): void {
    const { width: columns, height: rows, dtype, channels = 3 } = this.shape;
    let [across, down] = [width / columns, height / rows];
    if (fit === 'cover') across = down = Math.min(across, down);
    const corner = [(width - across * columns) / 2, (height - down * rows) / 2];
    const values = {
      ...{ corner, step: [across, down], size: [columns, rows], is_half: dtype === 'float16' ? 1 : 0 },
      ...{ channels, first_word: view * this.#words },
    };
    writeUniform(this.#device, this.#uniform, layouts.ImageToTensor, values);
  }
}

/** Returns the size of an image source in pixels; 0 by 0 if the image has not loaded. */
function sizeOf(source: GPUCopyExternalImageSource): { width: number; height: number } {
  if ('displayWidth' in source) return { width: source.displayWidth, height: source.displayHeight };
  if ('videoWidth' in source) return { width: source.videoWidth, height: source.videoHeight };
  if ('naturalWidth' in source) return { width: source.naturalWidth, height: source.naturalHeight };
  return { width: source.width, height: source.height };
}

const oddHalves = (width: number, height: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'several images of float16',
    expected: 'an even number of elements in each',
    found: `${width} x ${height}`,
    remedy: 'export the model for images of an even width',
  });

const wrongSize = (width: number, height: number, max: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'an image for a model',
    expected: `1 to ${max} pixels across and down`,
    found: `${width} x ${height}`,
    remedy: 'wait until the image has loaded, or give a smaller one',
  });
