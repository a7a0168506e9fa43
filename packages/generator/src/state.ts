import type { Camera } from '@gaussian-splat/core';
import type { GpuTensor } from './input-value.js';

/** Inputs of a generator that a page may set, by their roles in the contract. */
export interface GeneratorState {
  /** Camera of the viewer; required if an input has a role that depends on it. */
  readonly camera?: Camera;
  /**
   * Seconds since the beginning. Default 0. The page is responsible for wrapping or stopping at the contract's
   * duration.
   */
  readonly timeSeconds?: number;
  /**
   * Index of a frame. Default: the frame at `timeSeconds` by the contract's fps, at most the last one of its duration;
   * 0 if the contract declares no fps.
   */
  readonly frame?: number;
  /** Seed for random numbers. Default 0. */
  readonly seed?: number;
  /**
   * Flattened pose, in the order and format of the contract; with several inputs of this role, their numbers in the order
   * of the file's inputs. Default: that of the contract, else no rotation.
   */
  readonly pose?: ArrayLike<number>;
  /** Shape coefficients, with several inputs as for {@link pose}. Default: those of the contract, else zeros. */
  readonly shape?: ArrayLike<number>;
  /**
   * Values of controls, poses and shapes by input name: one number for all elements, or a number for each. They have
   * priority over {@link pose} and {@link shape}. Default: those of the contract.
   */
  readonly controls?: Readonly<Record<string, number | ArrayLike<number>>>;
  /**
   * Images [1, 3, H, W] by the names of inputs with the role `image`, for example from the renderer's `ImageTensor`.
   * Required for every such input, unless an earlier model of a chain writes it.
   */
  readonly images?: Readonly<Record<string, GpuTensor>>;
  /**
   * Depth [1, 1, H, W] of the frame, for example from the renderer's `ImageTensor`. Required for inputs with the role
   * `depth` of a post-processor.
   */
  readonly depth?: GpuTensor;
}
