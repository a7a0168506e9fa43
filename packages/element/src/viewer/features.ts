import { Lazy, type Camera } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { Attributes } from './attributes.js';
import type { Frame } from '../sources/generator/frame-filter.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';

/**
 * A capability whose code is loaded when a page uses it: walking, views, labels, effects, the sky, the shadow ... The
 * element calls these members at the times that they name, and knows nothing else of it.
 */
export interface Feature {
  /**
   * Called in each frame before the camera steps.
   * @param now requestAnimationFrame's clock, ms.
   * @returns Whether another frame is needed.
   */
  advance?(now: number): boolean;
  /** Called before the commands of a frame are recorded. */
  prepareFrame?(): void;
  /** Draws beneath the splats of a frame. */
  drawBeneath?(frame: Frame): Partial<FrameTarget>;
  /** Called after a frame was submitted, with its camera. */
  frameDrawn?(camera: Camera): void;
  /** Called before the first frame of a scene, which waits for it. */
  prepareFor?(scene: LoadedGaussians): Promise<void>;
  /** Called after the canvas was cleared. */
  cleared?(): void;
  /** Called after the children of the element have changed. */
  childrenChanged?(): void;
}

type Call<K extends keyof Feature> = NonNullable<Feature[K]>;

/** When the code of a feature is loaded without being asked for; it stays loaded. */
export interface Wanted {
  /** Checked after each update of the element. */
  readonly by?: (attributes: Attributes) => unknown;
  /** Selector of children that need the feature. */
  readonly children?: string;
}

/** The features of an element: what loads each of them, and those that are loaded. */
export class Features {
  readonly #rows: (readonly [Wanted, Lazy<unknown>])[] = [];
  readonly #loaded: Feature[] = [];
  readonly #update: () => void;

  /** @param update Called when the code of a feature is loaded. */
  constructor(update: () => void) {
    this.#update = update;
  }

  /**
   * Adds a feature.
   * @param what Purpose of the code for error messages, as in "the code for walking".
   * @param open Imports the code, and returns the feature or any other object.
   */
  add<T extends object>(what: string, wanted: Wanted, open: () => Promise<T>): Lazy<T> {
    const load = async (): Promise<T> => this.use<T & Feature>(await open());
    const lazy = new Lazy(what, load, this.#update);
    this.#rows.push([wanted, lazy]);
    return lazy;
  }

  /** Calls a feature from now on. */
  use<T extends Feature>(feature: T): T {
    this.#loaded.push(feature);
    return feature;
  }

  /** Loads the code that attributes need. */
  readAttributes(attributes: Attributes, onError: (error: Error) => void): void {
    for (const [{ by }, lazy] of this.#rows) if (by?.(attributes)) lazy.want(onError);
  }

  /** Loads the code that children need, and calls `childrenChanged`. */
  readChildren(element: HTMLElement, onError: (error: Error) => void): void {
    for (const [{ children }, lazy] of this.#rows) if (children && element.querySelector(children)) lazy.want(onError);
    this.call('childrenChanged');
  }

  /** Calls a member of all loaded features that have it. */
  call<K extends keyof Feature>(name: K, ...args: Parameters<Call<K>>): ReturnType<Call<K>>[] {
    return this.#loaded.flatMap((feature) =>
      feature[name] ? [(feature[name] as (...args: unknown[]) => ReturnType<Call<K>>)(...args)] : [],
    );
  }
}
