import { Lazy, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { TemplateResult } from 'lit';
import type { AttributeTable } from './attribute.js';
import type { FeatureNavigations } from './attributes.js';
import type { CameraAction } from './camera/gestures.js';
import type { Frame } from '../sources/generator/frame-filter.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { Player } from './playback-controller.js';
import type { TemplateModel } from './template.js';
import type { Viewer } from './viewer.js';

/**
 * A capability whose code is loaded when a page uses it: walking, views, labels, effects, the sky, the shadow ... The
 * viewer calls these members at the times that they name, and knows nothing else of it. Of the members that return a
 * value or undefined, the first value counts, in the order of the rows.
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
  /** Called after the camera has moved. */
  cameraMoved?(): void;
  /** Called when a visitor moves the camera. */
  touched?(): void;
  /** Called when a visitor or a flight takes the camera, so that automatic motion waits. */
  rest?(): void;
  /** Applies a visitor's gesture or key. @returns Whether it has an effect; undefined leaves it to others. */
  act?(action: CameraAction): boolean | undefined;
  /** Takes a double click or a double tap at CSS pixels of the viewport. */
  pick?(clientX: number, clientY: number): true | undefined;
  /** Stops or resumes automatic motion, for the space bar. @returns true if there is any. */
  toggleMotion?(): true | undefined;
  /** Whether a session in a headset continues with the scene that is being loaded. */
  keepsSession?(): true | undefined;
  /** Called in each frame of a headset. @param head Position of the head, viewer space in meters. */
  headMoved?(head: Vector3): void;
  /** Whether automatic motion is allowed. The visitor may have stopped it. */
  mayMove?(): boolean;
  /** Returns the player of all automatic playback: `player` together with that of the feature. */
  playerWith?(player: Player | undefined): Player | undefined;
  /** Fraction of a file that has arrived and the next scene waits for, 0..1; null while unknown, undefined for none. */
  progress?(): number | null | undefined;
  /** Help text for the keys, for screen readers. */
  keys?(): string | undefined;
  /** Parts of the shadow tree. They lie over the frame, and below the poster. */
  view?(model: TemplateModel): TemplateResult | undefined;
  /** Names of slots. Each gets a box in the layer over the frame. */
  slots?(): readonly string[];
}

/** A row of the table of features: when its code is loaded, and what it adds to the element. */
export interface FeatureRow {
  /** Purpose of the code for error messages, as in "the code for walking". */
  readonly what: string;
  readonly attributes?: AttributeTable;
  /** Kind of camera motion that the feature adds to the attribute `navigation`. */
  readonly navigation?: keyof FeatureNavigations;
  /** Whether the page needs the feature. Checked after each update of the element; loaded code stays. */
  readonly by?: (viewer: Viewer) => unknown;
  /** Selector of children that need the feature. */
  readonly children?: string;
  /** Attributes of children that change what the feature shows. `slot` is one of all. */
  readonly childAttributes?: readonly string[];
  /** Whether the first frame of a scene waits for code that is being loaded. */
  readonly precedesFrames?: boolean;
  /** Imports the code, and returns the feature. */
  readonly open: (viewer: Viewer) => Promise<object>;
}

/** The rows of all features, by name, in the order of their calls. */
export type FeatureTable = Readonly<Record<string, FeatureRow>>;

type Call<K extends keyof Feature> = NonNullable<Feature[K]>;
type Result<K extends keyof Feature> = ReturnType<Call<K>>;

/** The features of one element: when each of them is loaded, and those that are. */
export class Features {
  readonly #rows: ReadonlyMap<string, readonly [FeatureRow, Lazy<Feature>]>;
  readonly #loaded = new Map<string, Feature>();
  readonly #viewer: Viewer;

  constructor(table: FeatureTable, viewer: Viewer) {
    this.#viewer = viewer;
    const lazy = ([name, row]: [string, FeatureRow]): [string, [FeatureRow, Lazy<Feature>]] => {
      const open = async (): Promise<Feature> => {
        const feature = (await row.open(viewer)) as Feature;
        this.#loaded.set(name, feature);
        return feature;
      };
      return [name, [row, new Lazy(row.what, open, () => viewer.element.requestUpdate())]];
    };
    this.#rows = new Map(Object.entries(table).map(lazy));
  }

  /** Returns a feature by the name of its row, for code that calls more of it than {@link Feature} has. */
  get<T extends object>(name: string): Lazy<T> {
    return this.#rows.get(name)![1] as unknown as Lazy<T>;
  }

  /** Fulfills when no code of features is being loaded. Never rejects. */
  get settled(): Promise<unknown> {
    return Promise.all([...this.#rows.values()].map(([, lazy]) => lazy.settled));
  }

  /** Fulfills when the code is loaded that a first frame waits for. Never rejects. */
  get readyForFrames(): Promise<unknown> {
    return Promise.all([...this.#rows.values()].map(([row, lazy]) => row.precedesFrames && lazy.settled));
  }

  get childAttributes(): readonly string[] {
    return [...this.#rows.values()].flatMap(([{ childAttributes = [] }]) => childAttributes);
  }

  /** Loads the code that attributes need. */
  readAttributes(): void {
    for (const [{ by }, lazy] of this.#rows.values()) if (by?.(this.#viewer)) lazy.want(this.#viewer.warnOf);
  }

  /** Loads the code that children need, and calls `childrenChanged`. */
  readChildren(): void {
    const { element, warnOf } = this.#viewer;
    for (const [{ children }, lazy] of this.#rows.values())
      if (children && element.querySelector(children)) lazy.want(warnOf);
    this.call('childrenChanged');
  }

  /** Calls a member of all loaded features that have it, in the order of the rows. */
  call<K extends keyof Feature>(name: K, ...args: Parameters<Call<K>>): Result<K>[] {
    return [...this.#rows.keys()].flatMap((row) => {
      const feature = this.#loaded.get(row);
      return feature?.[name] ? [(feature[name] as (...args: unknown[]) => Result<K>)(...args)] : [];
    });
  }

  /** Returns the first defined result of {@link call}, and calls no further feature. */
  first<K extends keyof Feature>(name: K, ...args: Parameters<Call<K>>): Result<K> | undefined {
    for (const row of this.#rows.keys()) {
      const feature = this.#loaded.get(row);
      const result = (feature?.[name] as ((...args: unknown[]) => Result<K>) | undefined)?.call(feature, ...args);
      if (result !== undefined) return result;
    }
    return undefined;
  }
}
