import type { Camera } from '@gaussian-splat/core';
import type { GpuTensor } from './input-value.js';

/** Inputs of a generator that a page may set, by the roles of its contract. */
export interface GeneratorState {
  /** Camera of the viewer; required by every role that depends on it. */
  readonly camera?: Camera;
  /** Seconds since the beginning; default 0. The page wraps or stops it at the contract's duration. */
  readonly timeSeconds?: number;
  /**
   * Index of a frame; default: the frame at `timeSeconds` by the contract's fps, limited to the last of its duration;
   * without fps 0.
   */
  readonly frame?: number;
  /** Default 0. */
  readonly seed?: number;
  /** Flattened, in the order and format of the contract; default: the contract's, else no rotation. */
  readonly pose?: ArrayLike<number>;
  /** Coefficients; default: the contract's, else zeros. */
  readonly shape?: ArrayLike<number>;
  /**
   * Values of controls by the name of the input: one number for all elements, or all of them; default: the contract's.
   */
  readonly controls?: Readonly<Record<string, number | ArrayLike<number>>>;
  /**
   * Images [1,3,H,W] by the names of inputs with the role `image`, for example from the renderer's `ImageTensor`;
   * required by every such input that no earlier model of a chain writes.
   */
  readonly images?: Readonly<Record<string, GpuTensor>>;
  /** Depth [1,1,H,W] of the frame that a post-processor takes, for example made by the renderer's `ImageTensor`; needed by inputs with the role `depth`. */
  readonly depth?: GpuTensor;
}
