import { present, tensorToImage } from '../generated/live-shaders.js';
import * as layouts from '../generated/live-layouts.js';
import { BUFFER_USAGE, TEXTURE_USAGE } from '../gpu/kernel.js';
import { writeUniform } from '../gpu/one-off.js';
import { FullScreenStage } from '../stages/full-screen.js';
import { SceneDepth } from '../scene-depth.js';
import { ImageTensor, type ImageShape } from './image-tensor.js';

/** Output image of a model, on the GPU. */
export interface ModelImage {
  readonly buffer: GPUBuffer;
  readonly dtype: 'float32' | 'float16';
  /** [1, 3, height, width] or [3, height, width]; a fourth plane is ignored */
  readonly dims: readonly number[];
}

const [FORMAT, PIXEL_BYTES] = ['rgba16float', 8] as const;
/** Maximum number of buffers of models with cached bindings. */
const MAX_BINDINGS = 8;

/**
 * Textures of one frame that a model processes, all of the same size: the drawn frame, the input frame of the model,
 * and the filtered frame.
 *
 * ```ts
 * const frame = new FilteredFrame(device, width, height);
 * viewpoint.draw(camera, { target: frame.drawn });
 * const tensor = frame.handOver({ width: 256, height: 256, dtype: 'float32' }); // to the model
 * frame.accept(image); // from the model
 * frame.present('filtered', canvasTexture);
 * ```
 */
export class FilteredFrame {
  readonly width: number;
  readonly height: number;
  /** Target texture for the renderer. */
  readonly drawn: GPUTexture;
  /** Depth output of the drawn frame, for its frame target; undefined if the model does not take depth. */
  readonly depth: SceneDepth | undefined;
  readonly #depthTexture: GPUTexture | undefined;
  #depthTensor: ImageTensor | undefined;
  readonly #device: GPUDevice;
  readonly #handed: GPUTexture;
  readonly #filtered: GPUTexture;
  readonly #present: FullScreenStage<typeof present>;
  readonly #paint: FullScreenStage<typeof tensorToImage>;
  readonly #uniform: GPUBuffer;
  readonly #bindings = new Map<GPUBuffer, GPUBindGroup>();
  readonly #shown: Readonly<Record<'drawn' | 'filtered', GPUBindGroup>>;
  readonly #filteredView: GPUTextureView;
  #tensor: ImageTensor | undefined;

  /**
   * @param takesDepth Whether the model also takes the depth of the frame. Draw frames with {@link depth} then, by the
   * rasterizer `tiles`.
   */
  constructor(device: GPUDevice, width: number, height: number, takesDepth = false) {
    this.width = width;
    this.height = height;
    this.#device = device;
    this.drawn = this.#texture('drawn', TEXTURE_USAGE.copySource | TEXTURE_USAGE.storageBinding);
    this.#handed = this.#texture('handed', TEXTURE_USAGE.copyDestination);
    this.#filtered = this.#texture('filtered', 0);
    this.#filteredView = this.#filtered.createView();
    if (takesDepth) {
      this.#depthTexture = device.createTexture({
        label: 'gs.filter.depth',
        size: [width, height],
        format: 'r32float',
        usage: TEXTURE_USAGE.textureBinding | TEXTURE_USAGE.storageBinding,
      });
      this.depth = new SceneDepth(device, { out: this.#depthTexture });
    }
    this.#present = new FullScreenStage(device, present);
    this.#paint = new FullScreenStage(device, tensorToImage);
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#uniform = device.createBuffer({ label: 'gs.filter.uniform', size: layouts.TensorToImage.size, usage });
    this.#shown = {
      drawn: this.#present.bind({ source: this.drawn.createView() }),
      filtered: this.#present.bind({ source: this.#filteredView }),
    };
  }

  /** Bytes of allocated GPU memory. */
  get byteLength(): number {
    const tensors = (this.#tensor?.byteLength ?? 0) + (this.#depthTensor?.byteLength ?? 0);
    const pixelBytes = 3 * PIXEL_BYTES + (this.depth ? 4 : 0);
    return pixelBytes * this.width * this.height + this.#uniform.size + tensors;
  }

  /**
   * Copies the drawn frame to a tensor for the model, and keeps the frame for the alpha of the result. Both do not
   * change until the next call.
   */
  handOver(shape: ImageShape): ImageTensor {
    const { width, height, dtype, channels } = this.#tensor?.shape ?? {};
    const isSame = width === shape.width && height === shape.height && dtype === shape.dtype;
    if (!isSame || channels !== shape.channels) {
      this.#tensor?.destroy();
      this.#tensor = new ImageTensor(this.#device, shape);
    }
    const encoder = this.#device.createCommandEncoder({ label: 'gs.filter.hand-over' });
    const size = [this.width, this.height];
    encoder.copyTextureToTexture({ texture: this.drawn }, { texture: this.#handed }, size);
    this.#device.queue.submit([encoder.finish()]);
    this.#tensor!.write(this.#handed);
    return this.#tensor!;
  }

  /**
   * Copies the depth of the drawn frame to a tensor [1, 1, height, width] for the model. The tensor does not change
   * until the next call.
   */
  handOverDepth({ width, height, dtype }: Pick<ImageShape, 'width' | 'height' | 'dtype'>): ImageTensor {
    const { shape } = this.#depthTensor ?? {};
    if (shape?.width !== width || shape.height !== height || shape.dtype !== dtype) {
      this.#depthTensor?.destroy();
      this.#depthTensor = new ImageTensor(this.#device, { width, height, dtype, channels: 1 });
    }
    this.#depthTensor!.write(this.#depthTexture!, 'stretch', 0, this.depth!.drawn);
    return this.#depthTensor!;
  }

  /** Accepts the model's output for the last input frame. The work is submitted before the function returns. */
  accept({ buffer, dtype, dims }: ModelImage): void {
    const values = { size: [dims.at(-1)!, dims.at(-2)!], is_half: dtype === 'float16' ? 1 : 0 };
    writeUniform(this.#device, this.#uniform, layouts.TensorToImage, values);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.filter.accept' });
    this.#paint.record(encoder, this.#bindingsOf(buffer), this.#filteredView, FORMAT);
    this.#device.queue.submit([encoder.finish()]);
  }

  /** Copies the drawn or the filtered frame to a texture of the same size. */
  present(image: 'drawn' | 'filtered', target: GPUTexture): void {
    const encoder = this.#device.createCommandEncoder({ label: 'gs.filter.present' });
    this.#present.record(encoder, this.#shown[image], target.createView(), target.format);
    this.#device.queue.submit([encoder.finish()]);
  }

  destroy(): void {
    for (const texture of [this.drawn, this.#handed, this.#filtered]) texture.destroy();
    this.#uniform.destroy();
    this.depth?.destroy();
    this.#depthTexture?.destroy();
    this.#depthTensor?.destroy();
    this.#tensor?.destroy();
    this.#bindings.clear();
  }

  #texture(name: string, more: GPUTextureUsageFlags): GPUTexture {
    return this.#device.createTexture({
      label: `gs.filter.${name}`,
      size: [this.width, this.height],
      format: FORMAT,
      usage: TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.textureBinding | more,
    });
  }

  #bindingsOf(tensor: GPUBuffer): GPUBindGroup {
    let bindings = this.#bindings.get(tensor);
    if (bindings === undefined) {
      if (this.#bindings.size >= MAX_BINDINGS) this.#bindings.clear();
      bindings = this.#paint.bind({ image: this.#uniform, tensor, frame: this.#handed.createView() });
      this.#bindings.set(tensor, bindings);
    }
    return bindings;
  }
}
