import type { SplatShader } from '@gaussian-splat/renderer/modifiers';
import { LitElement, type PropertyDeclarations } from 'lit';
import { declarations, flags, type AttributeProperties } from './attributes.js';
import type { GaussianSplatEventMap } from './events.js';
import type { ControlValues } from './live/values.js';

/** Those of the element, and under other names those of every element: `click`, `keydown`. */
type ElementEvents = GaussianSplatEventMap & Omit<HTMLElementEventMap, keyof GaussianSplatEventMap>;

/** The properties of `<gaussian-splat>` that are attributes, too, and those that Lit has to know besides. */
// The interface below gives the attributes of attributes.ts and inherited methods their types: Lit makes the accessors of the first, and has the others.
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class SplatProperties extends LitElement {
  static override properties: PropertyDeclarations = {
    ...declarations(),
    inputValues: { attribute: false },
    splatShader: { attribute: false },
    revealProgress: { attribute: false },
    // Accessors of MediaProperties: named here so that what a page sets before the element is defined reaches them.
    currentTime: { attribute: false, noAccessor: true },
    playbackRate: { attribute: false, noAccessor: true },
  };

  /** Controls of a generator by the names of its inputs; above the attributes `control-NAME`. New values are a new object. */
  declare inputValues: ControlValues | null;

  /**
   * A WGSL function of the page for each splat, `{ code, uniforms, animated, moves }`; null for none. New values are a new object; the same code is not compiled again. `shader-error` tells of
   * one that does not compile.
   */
  declare splatShader: SplatShader | null;

  /** How far the scene has appeared with `reveal-effect`, 0 to 1: for pages that drive it, by scrolling for example. null, the default: by time. */
  declare revealProgress: number | null;

  static {
    // The element draws, and so learns what its template shows, after an update. Lit's development build warns of that.
    this.disableWarning?.('change-in-update');
  }

  constructor() {
    super();
    // Boolean properties start as booleans: frameworks look at them to decide what a bare attribute means.
    Object.assign(this, Object.fromEntries(flags.map((name) => [name, false])));
  }
}

// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export interface SplatProperties extends AttributeProperties {
  addEventListener<K extends keyof ElementEvents>(
    type: K,
    listener: (this: this, event: ElementEvents[K]) => unknown,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions,
  ): void;
  removeEventListener<K extends keyof ElementEvents>(
    type: K,
    listener: (this: this, event: ElementEvents[K]) => unknown,
    options?: boolean | EventListenerOptions,
  ): void;
  removeEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | EventListenerOptions,
  ): void;
}
