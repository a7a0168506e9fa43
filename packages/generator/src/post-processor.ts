import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';
import { Chain, requireNoneBefore } from './chain/chain.js';
import { imageShapeOf } from './bind-images.js';
import { sameInputs, type GpuTensor, type Inputs } from './input-value.js';
import { RunLoop } from './run-loop.js';
import type { Generator } from './generator.js';
import type { SessionKind } from './runtime/ort-session.js';
import type { GeneratorModel, ModelSource } from './runtime/open-model.js';
import type { AcquireOptions } from './runtime/shared-sessions.js';
import type { GeneratorState } from './state.js';

/** Name and requirements of an input for an image. */
export type ImageInput = ReturnType<typeof imageShapeOf> & { readonly name: string };

/** Output image of a model on the GPU: [1, 3, H, W], planes of red, green and blue, 0..1. */
export type FinishedImage = GpuTensor & { readonly dtype: 'float32' | 'float16' };

export interface PostProcessorOptions extends AcquireOptions {
  /**
   * Called with the finished image, [1, 3, H, W]. The function must submit its GPU work before it returns, because the
   * runtime then reuses the buffer.
   */
  readonly onImage: (image: FinishedImage) => void;
  /** Called with the error of a failed run. The next request tries again. */
  readonly onError?: (error: unknown) => void;
}

/** Number of runs for one image, after which a filter that keeps 0.8 of its output is within 1/1000 of its limit. */
const MAX_REPEATS = 32;

interface RunRequest {
  readonly inputs: readonly Inputs[];
}

/**
 * A model, or a chain of models, that processes an image from GPU buffer to GPU buffer, such as a style or a denoiser.
 *
 * ```ts
 * const post = await PostProcessor.open({ url: 'style.onnx' }, device, { onImage: paint });
 * post.request(imageTensor, { controls: { strength: 0.5 } });
 * ```
 */
export class PostProcessor {
  /** The input that receives the image. It is an input of the first model of a chain. */
  readonly input: ImageInput;
  /** The input that takes the depth of the frame; undefined if no model has such an input. */
  readonly depth: ImageInput | undefined;
  /** All models, in execution order. */
  readonly models: readonly GeneratorModel[];
  readonly #chain: Chain;
  readonly #options: PostProcessorOptions;
  readonly #loop: RunLoop<RunRequest>;
  #shown: RunRequest['inputs'] | undefined;
  /** Number of consecutive runs with the same inputs, for models with state. */
  #repeats = 0;
  #version = 0;
  #followed: Generator | undefined;
  #unfollow: (() => void) | undefined;

  private constructor(chain: Chain, options: PostProcessorOptions) {
    this.#chain = chain;
    this.#options = options;
    this.models = chain.models;
    this.input = imageInput(this.models);
    this.depth = depthInput(this.models);
    this.#loop = new RunLoop({
      queue: chain.device.queue,
      isDue: ({ inputs }) => !this.#isShown(inputs) || this.isConverging,
      run: (request) => this.#run(request),
      onError: (error) => this.#options.onError?.(error),
    });
  }

  /**
   * Fetches and checks a post-processor. The runtime is not fetched yet.
   * @throws ContractError, GaussianSplatError: see `openModel`; ContractError `contract/chain` for models that do not
   * match, or do not convert one image to one image.
   */
  static async open(
    source: ModelSource | readonly ModelSource[],
    device: GPUDevice,
    options: PostProcessorOptions,
  ): Promise<PostProcessor> {
    let post: PostProcessor | undefined;
    const onFallback = (reason: string): void => {
      // Makes the next request run even for the same frame.
      if (post) post.#forget();
      options.onFallback?.(reason);
    };
    const chain = await Chain.open(source, device, { ...options, onFallback });
    try {
      return (post = new PostProcessor(chain, options));
    } catch (error) {
      chain.release();
      throw error;
    }
  }

  /** Slowest session kind of all models; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#chain.kind;
  }

  /** Whether a run is in progress. The input image must not change meanwhile. */
  get isBusy(): boolean {
    return this.#loop.isBusy;
  }

  /** Whether another run of the same image may still change the result. */
  get isConverging(): boolean {
    return this.#shown !== undefined && this.#keepsState && this.#repeats < MAX_REPEATS;
  }

  /** Milliseconds from the start of the last finished run until the GPU had finished it; undefined before the first. */
  get milliseconds(): number | undefined {
    return this.#loop.milliseconds;
  }

  /** Fulfills when no run is in progress. Never rejects. */
  get idle(): Promise<void> {
    return this.#loop.idle;
  }

  /** Whether the first model takes the Gaussians of the frame's generator beside its image: see {@link follow}. */
  get takesGaussians(): boolean {
    return this.#chain.takesGaussians;
  }

  /**
   * Sets the generator whose Gaussians the first model takes. The generator runs once more, for the first ones. A call
   * with the same generator has no effect.
   * @throws ContractError `contract/chain` if the outputs of the generator do not match the inputs, if it declares
   * instances, or if there is no generator, as with a file.
   */
  follow(generator: Generator | undefined): void {
    if (!this.takesGaussians || (generator && generator === this.#followed)) return;
    this.#unfollow?.();
    this.#followed = undefined;
    if (generator === undefined) return requireNoneBefore(this.models[0]);
    const gaussians = this.#chain.follow(generator.model);
    const unfollow = generator.follow((outputs) => gaussians.take(outputs));
    this.#unfollow = () => {
      unfollow();
      void this.#loop.idle.then(() => gaussians.destroy());
    };
    this.#followed = generator;
  }

  /**
   * Requests the processed image, and returns at once. Replaces a request that has not started yet. A request with the
   * inputs of the last run is skipped; models with state run it 32 times, to converge. A request before the first
   * Gaussians of {@link follow} is skipped, too.
   * @param image Image for {@link input}; its `version` identifies its content.
   * @param state State of the page, with `depth` if a model takes it: see {@link depth}.
   * @throws GaussianSplatError `argument/value` if the image or the state does not match the model.
   */
  request(image: GpuTensor, state: GeneratorState = {}): void {
    if (this.#loop.isClosed || (this.takesGaussians && !this.#chain.hasGaussians)) return;
    const images = { ...state.images, [this.input.name]: image };
    this.#loop.request({ inputs: this.#chain.bind({ ...state, images }) });
  }

  /** Closes the post-processor. A run in progress has no effect anymore. */
  close(): void {
    this.#loop.close();
    this.#unfollow?.();
    this.#chain.release(this.#loop.idle);
  }

  #isShown(inputs: RunRequest['inputs']): boolean {
    return this.#shown?.every((shown, i) => sameInputs(shown, inputs[i])) ?? false;
  }

  /** Whether any model has state, so that the result for one image may change from run to run. */
  get #keepsState(): boolean {
    return this.models.some(({ contract }) => Object.values(contract.inputs).some(({ role }) => role === 'state'));
  }

  #forget(): void {
    this.#shown = undefined;
    this.#chain.forget();
  }

  #run({ inputs }: RunRequest): Promise<void> {
    const { name, dtype } = this.models.at(-1)!.outputs[0] as { name: string; dtype: FinishedImage['dtype'] };
    return this.#chain.run(inputs, ({ tensors, dims }) => {
      if (this.#loop.isClosed) return;
      this.#repeats = this.#isShown(inputs) ? this.#repeats + 1 : 0;
      this.#shown = inputs;
      this.#options.onImage({ buffer: tensors[name], dtype, dims: dims[name], version: ++this.#version });
    });
  }
}

function imageInput(models: readonly GeneratorModel[]): ImageInput {
  const [{ header, contract }] = models;
  const inputs = header.inputs.filter(({ name }) => contract.inputs[name].role === 'image');
  const faults = models
    .filter(({ layout }) => layout !== undefined)
    .map((model) => unsuitable(model, 'a model that writes an image', 'a model that writes Gaussians'));
  const images = inputs.reduce((sum, input) => sum + imageShapeOf(input).views, 0);
  if (images !== 1) faults.push(unsuitable(models[0], 'one input with the role image', `${images} images`));
  if (faults.length > 0) throw new ContractError(faults);
  const [input] = inputs;
  return { name: input.name, ...imageShapeOf(input) };
}

/**
 * Returns the input for the depth of the frame; undefined if no model has one. All models of a chain must take the
 * depth in one size and element type.
 */
function depthInput(models: readonly GeneratorModel[]): ImageInput | undefined {
  const inputs = models.flatMap((model) =>
    model.header.inputs
      .filter(({ name }) => model.contract.inputs[name].role === 'depth')
      .map((input) => ({ model, input: { name: input.name, ...imageShapeOf(input), channels: 1 as const } })),
  );
  const sizeOf = ({ width, height, dtype }: ImageInput): string => `${dtype} [1,1,${height ?? 'H'},${width ?? 'W'}]`;
  const faults = inputs
    .filter(({ input }) => sizeOf(input) !== sizeOf(inputs[0].input))
    .map(({ model, input }) =>
      unsuitable(model, `depth as ${sizeOf(inputs[0].input)}, as in another model`, sizeOf(input)),
    );
  if (faults.length > 0) throw new ContractError(faults);
  return inputs.at(0)?.input;
}

const unsuitable = ({ header }: GeneratorModel, expected: string, found: string): ContractFault => ({
  code: 'contract/chain',
  where: header.name,
  expected,
  found,
  remedy: 'use a model that makes an image from an image; one that writes Gaussians belongs in src',
});
