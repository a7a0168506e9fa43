import type { Camera } from '@gaussian-splat/core';
import type { GpuTensor } from './input-value.js';

/** Everything that a page may set about a generator: what the roles of a contract are fed from. */
export interface GeneratorState {
  /** Where the viewer is; needed by every role that speaks of the camera. */
  readonly camera?: Camera;
  /** Seconds since the beginning; default 0. Beyond the contract's duration it is the page's to wrap or to stop. */
  readonly timeSeconds?: number;
  /** Index of a frame; default: the one that `timeSeconds` falls into by the contract's fps, and the last of its duration from there on; without fps 0. */
  readonly frame?: number;
  /** Default 0. */
  readonly seed?: number;
  /** Flattened, in the order and format that the contract declares; default: the contract's, else no rotation. */
  readonly pose?: ArrayLike<number>;
  /** Coefficients; default: the contract's, else zeros. */
  readonly shape?: ArrayLike<number>;
  /** Values of controls by the name of the input: one number for all elements, or all of them; default: the contract's. */
  readonly controls?: Readonly<Record<string, number | ArrayLike<number>>>;
  /**
   * Images [1,3,H,W] by the names of inputs with the role `image`, for example made by the renderer's `ImageTensor`; needed by every such
   * input that no model before it in a chain writes.
   */
  readonly pictures?: Readonly<Record<string, GpuTensor>>;
}
