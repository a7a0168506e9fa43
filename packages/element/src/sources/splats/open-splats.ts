/** Shows the arrays of the property `splats`. The module is loaded only for them. */
import { boundsOf } from '@gaussian-splat/core';
import { ARRAYS, numbersOf, type ArrayName } from '@gaussian-splat/formats/updates';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import { ArrayGaussians, type ArrayLayout } from '@gaussian-splat/renderer/tools';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import { images, unlessWrong } from '../../gpu/initial-frames.js';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import type { DynamicListeners, Timeline } from '../generator/dynamic-model.js';
import type { OpenOptions, OpenSource } from '../source-kind.js';
import { SplatInput, type ChangedRange, type SplatSink, type SplatState } from './splat-input.js';
import { nothingToDraw, sampleOf, unusableRows } from './rows.js';

/** Opens the splats that the property of an element contains, or that its feed sends first. */
export const open: OpenSource = async ({ limits }, options, acquiring) => {
  const { signal, beforeUpload, memoryBudget, submissions, live } = options;
  const { element, listeners } = live();
  const input = SplatInput.of(element);
  const state = await input.first(signal, limits);
  const lease = await acquiring;
  signal.throwIfAborted();
  limitScenes(lease.device, memoryBudget);
  await pickInitialVariants(lease.device, images()).catch(unlessWrong);
  beforeUpload(bytesOf(state));
  const player = await SplatsPlayer.open(input, state, { device: lease.device, listeners, memoryBudget });
  if (signal.aborted) player.gaussians.destroy();
  signal.throwIfAborted();
  player.scene = new LoadedGaussians(lease, player.gaussians, player.bounds, submissions, { live: player });
  input.attach(player, state);
  return player.scene;
};

const bytesOf = ({ arrays }: SplatState): number =>
  Object.values(arrays).reduce((sum, values) => sum + values.byteLength, 0);

const layoutOf = ({ arrays, shDegree, raw, rule, origin }: SplatState): ArrayLayout => ({
  ...rule,
  shDegree: arrays.sh ? shDegree : undefined,
  raw,
  origin,
});

interface PlayerOptions extends Pick<OpenOptions, 'memoryBudget'> {
  readonly device: GPUDevice;
  readonly listeners: DynamicListeners;
}

/** Uploads the states of a {@link SplatInput}. The clock of the element has no effect on them. */
class SplatsPlayer implements Timeline, SplatSink {
  readonly duration = NaN;
  /** Whether a frame has been drawn since the last state was shown. */
  isReady = false;
  /** Scene that shows the splats. Its creator sets this property once. */
  scene: LoadedGaussians | undefined;
  readonly #input: SplatInput;
  readonly #options: PlayerOptions;
  #gaussians: ArrayGaussians;
  #state: SplatState;
  #bounds: SceneBounds;
  #boundsOf: SplatState;
  readonly #unusable: number[] = [];
  #isClosed = false;

  private constructor(input: SplatInput, gaussians: ArrayGaussians, state: SplatState, options: PlayerOptions) {
    this.#input = input;
    this.#gaussians = gaussians;
    this.#state = this.#boundsOf = state;
    this.#bounds = boundsOfState(state);
    this.#options = options;
  }

  /** Uploads the first state. Rejects with GaussianSplatError `argument/cloud` or `out-of-memory/*`. */
  static async open(input: SplatInput, state: SplatState, options: PlayerOptions): Promise<SplatsPlayer> {
    const gaussians = await allocate(state, options);
    const player = new SplatsPlayer(input, gaussians, state, options);
    try {
      await player.#upload(gaussians, state);
      return player;
    } catch (error) {
      gaussians.destroy();
      throw error;
    }
  }

  get gaussians(): ArrayGaussians {
    return this.#gaussians;
  }

  /** Bounds of a sample of the splats that are shown. */
  get bounds(): SceneBounds {
    if (this.#boundsOf !== this.#state) {
      this.#boundsOf = this.#state;
      this.#bounds = boundsOfState(this.#state);
    }
    return this.#bounds;
  }

  /** Called in each frame. */
  request(): void {
    this.isReady = true;
    this.#input.proceed();
  }

  async show(state: SplatState, changed?: readonly ChangedRange[]): Promise<void> {
    this.isReady = false;
    const before = this.#gaussians;
    const gaussians = before.fits(state.count, layoutOf(state)) ? before : await allocate(state, this.#options);
    try {
      await this.#upload(gaussians, state, gaussians === before ? changed : undefined);
      if (gaussians !== before && this.#isClosed) return gaussians.destroy();
    } catch (error) {
      if (gaussians !== before) gaussians.destroy();
      this.isReady = true;
      throw error;
    }
    if (gaussians !== before) this.scene!.replaceGaussians(gaussians);
    this.#gaussians = gaussians;
    this.#state = state;
    this.#options.listeners.onInput();
  }

  fail(error: unknown): void {
    this.#options.listeners.onError(error);
  }

  close(): void {
    this.#isClosed = true;
    this.#input.detach(this);
  }

  /** Writes the changed values, default all, and shows them. */
  async #upload(gaussians: ArrayGaussians, state: SplatState, changed?: readonly ChangedRange[]): Promise<void> {
    const { count, arrays, shDegree } = state;
    const write = async (name: ArrayName, first: number, end: number): Promise<void> => {
      const stride = numbersOf(name, shDegree);
      if (arrays[name]) await gaussians.write(name, first, arrays[name].subarray(stride * first, stride * end));
    };
    for (const { name, first, count: length } of changed ?? []) await write(name, first, first + length);
    const unusable = this.#unusable;
    unusable.length = Math.ceil(count / ROWS);
    for (let k = 0; k < unusable.length; k++) {
      const [first, end] = [ROWS * k, Math.min(count, ROWS * (k + 1))];
      if (changed && !changed.some((range) => range.first < end && range.first + range.count > first)) continue;
      unusable[k] = unusableRows(state, first, end);
      if (!changed) for (const name of ARRAYS) await write(name, first, end);
    }
    const sum = unusable.reduce((total, rows) => total + rows, 0);
    if (sum === count && count > 0) throw nothingToDraw(count);
    if (!this.#isClosed) gaussians.show(count, sum);
  }
}

/** Number of splats that are checked and uploaded together: about a megabyte. */
const ROWS = 1 << 14;

const allocate = (state: SplatState, { device, memoryBudget }: PlayerOptions): Promise<ArrayGaussians> =>
  ArrayGaussians.create(device, state.count, layoutOf(state), { memoryBudget });

const boundsOfState = (state: SplatState): SceneBounds => ({ ...boundsOf(sampleOf(state)), up: state.up });
