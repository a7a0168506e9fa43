import type { SplatShader } from '@gaussian-splat/renderer/modifiers';
import { LitElement, type PropertyDeclarations } from 'lit';
import { declarations, flags, type AttributeProperties } from './attributes.js';
import type { GaussianSplatEventMap } from './events.js';
import type { ControlValues } from './dynamic/values.js';

/** Events of the element, plus the standard ones of every element, such as `click` and `keydown`. */
type ElementEvents = GaussianSplatEventMap & Omit<HTMLElementEventMap, keyof GaussianSplatEventMap>;

/** The properties of `<gaussian-splat>`: reflected attributes, and others declared to Lit. */
// The interface below gives the attributes of attributes.ts and inherited methods their types: Lit makes the accessors of the first, and has the others.
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class SplatProperties extends LitElement {
  static override properties: PropertyDeclarations = {
    ...declarations(),
    inputValues: { attribute: false },
    splatShader: { attribute: false },
    revealProgress: { attribute: false },
    // Accessors of MediaProperties, declared here so that values set before the element is defined reach them.
    currentTime: { attribute: false, noAccessor: true },
    playbackRate: { attribute: false, noAccessor: true },
  };

  /**
   * Controls of a generator by the names of its inputs; they override the attributes `control-NAME`. Assign a new
   * object to change values.
   */
  declare inputValues: ControlValues | null;

  /**
   * A WGSL function of the page for each splat, `{ code, uniforms, animated, moves }`; null for none. Assign a new
   * object to change values; equal code is not compiled again. The event `shader-error` reports code that does not
   * compile.
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
    // Boolean properties start as booleans: frameworks inspect them to decide the meaning of a bare attribute.
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
