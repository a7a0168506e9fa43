import type { SplatShader } from '@gaussian-splat/renderer/modifiers';
import { LitElement, type PropertyDeclarations } from 'lit';
import { declarations, type AttributeProperties } from './attributes.js';
import { ALL_ATTRIBUTES, flags } from './element-attributes.js';
import type { GaussianSplatEventMap } from './events.js';
import type { Splats } from '../sources/splats/splat-input.js';
import type { ControlValues } from '../sources/generator/values.js';

/** Events of the element, and the standard events of every element, such as `click` and `keydown`. */
type ElementEvents = GaussianSplatEventMap & Omit<HTMLElementEventMap, keyof GaussianSplatEventMap>;

/** Properties of `<gaussian-splat>`: the attributes, and properties without an attribute that are declared to Lit. */
// The interface below types the accessors that Lit creates for the attributes of attributes.ts, and the listeners of
// the events.
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class SplatProperties extends LitElement {
  static override properties: PropertyDeclarations = {
    ...declarations(ALL_ATTRIBUTES),
    splats: { attribute: false },
    inputValues: { attribute: false },
    splatShader: { attribute: false },
    revealProgress: { attribute: false },
    // MediaProperties has accessors for these. The declaration applies values that were set before the element was
    // defined.
    currentTime: { attribute: false, noAccessor: true },
    playbackRate: { attribute: false, noAccessor: true },
  };

  /**
   * Splats that the page shows instead of `src`: arrays, a `GaussianCloud`, or their sender, which is the address of a
   * WebSocket, a WebSocket, or a stream of bytes; null for none. Other splats replace them without a reload. Assign a
   * new object to change values.
   */
  declare splats: Splats | null;

  /**
   * Values of a generator's inputs by input name; they take precedence over the attributes `control-NAME`. Assign a new
   * object to change values.
   */
  declare inputValues: ControlValues | null;

  /**
   * The page's WGSL code that modifies each splat, `{ code, uniforms, animated, moves }`; null for none. Assign a new
   * object to change values; equal code is not compiled again. The event `shader-error` reports code that does not
   * compile.
   */
  declare splatShader: SplatShader | null;

  /**
   * Progress of `reveal-effect`, 0..1, for pages that control it, for example by scrolling. null, the default: progress
   * by time.
   */
  declare revealProgress: number | null;

  static {
    // The element requests another update after it has drawn. Lit's development build would warn of that.
    this.disableWarning?.('change-in-update');
  }

  constructor() {
    super();
    // Boolean properties are false at first: frameworks inspect the type of a property to interpret an attribute
    // without a value.
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
