import { ReactiveElement, type PropertyDeclarations } from 'lit';
import type { Matrix4, Vector3 } from '@gaussian-splat/core';
import { lightened, recolored, tinted, type CutShape, type SplatCut } from '@gaussian-splat/renderer/modifiers';
import { declarations } from '../../viewer/attributes.js';
import { readAttribute, type AttributeGrammar } from '../../viewer/camera/grammar.js';
import type { PropertiesOf } from '../../viewer/attribute.js';
import { matrixOf, readMatrix } from '../../viewer/camera/placing.js';
import { CUT_ATTRIBUTES, type CutEffect } from './attributes.js';

type Name = keyof typeof CUT_ATTRIBUTES;

/** A cut in the coordinates of its parent element, y up. `placed` maps the unit shape to these coordinates. */
export interface PlacedCut extends Omit<SplatCut, 'shapeToWorld'> {
  readonly placed: Matrix4;
  /** Names of the groups to which the cut is limited; undefined for all splats. */
  readonly names: readonly string[] | undefined;
}

/** For each `<gaussian-splat>`, the listener that is notified when one of its cuts changes. */
export const showers = new WeakMap<Element, { cutsChanged(): void }>();

/**
 * Hides, tints, fades or moves the splats in a region of space: a child of `<gaussian-splat>`, for all of its scenes,
 * or of one `<splat-scene>`.
 *
 * ```html
 * <gaussian-splat src="room.sog">
 *   <splat-cut shape="plane" position="0 2m 0" side="outside"></splat-cut>
 *   <splat-cut shape="sphere" scale="0.5" effect="tint" color="tomato"></splat-cut>
 * </gaussian-splat>
 * ```
 *
 * @tagname splat-cut
 */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class SplatCutElement extends ReactiveElement {
  static override properties: PropertyDeclarations = {
    ...declarations(CUT_ATTRIBUTES),
    matrix: { attribute: false },
    hidden: { type: Boolean, reflect: true },
  };

  /**
   * Complete transform of the shape, which overrides `position`, `rotation` and `scale`: 16 numbers of an affine
   * matrix, row-major, or a `DOMMatrix`. null for none.
   */
  declare matrix: ArrayLike<number> | DOMMatrixReadOnly | null;
  readonly #warned = new Set<string>();
  #cut: PlacedCut | undefined;
  #shower: Element | null = null;

  constructor() {
    super();
    this.hidden = false;
  }

  /** The parsed cut; undefined while the element is hidden. @internal */
  get cut(): PlacedCut | undefined {
    return this.hidden ? undefined : (this.#cut ??= this.#read());
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.#shower = this.closest('gaussian-splat');
    this.#notify();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#notify();
    this.#shower = null;
  }

  /** The element has no shadow tree, because it renders nothing. */
  protected override createRenderRoot(): HTMLElement {
    return this;
  }

  protected override updated(): void {
    this.#cut = undefined;
    this.#notify();
  }

  #notify(): void {
    if (this.#shower) showers.get(this.#shower)?.cutsChanged();
  }

  #read(): PlacedCut {
    const { matrix } = this;
    const vectors = {
      position: this.#value<Vector3>('position'),
      rotation: this.#value<Vector3>('rotation', 'rad'),
      scale: this.#value<Vector3>('scale'),
    };
    const placed = (matrix && readMatrix(matrix)) || matrixOf(vectors);
    const edge = this.#value<number | 'hard'>('edge');
    const names = this.group?.split(',').map((name) => name.trim());
    const shape = names && !this.shape ? 'everywhere' : this.#value<CutShape>('shape');
    return { placed, names, shape, side: this.#value('side'), edge, ...this.#readEffect() };
  }

  #readEffect(): Partial<SplatCut> {
    const signed = this.#value<number>('amount');
    const amount = Math.max(0, signed);
    switch (this.#value<CutEffect>('effect')) {
      case 'hide':
        return { opacity: 1 - amount };
      case 'fade':
        return { surfaceOpacity: 1 - amount };
      case 'tint':
        return { color: tinted(this.#value('color'), amount) };
      case 'lighten':
        return { color: lightened(signed) };
      case 'recolor':
        return { color: recolored(this.#value('hue', 'rad'), amount) };
      case 'displace':
        return { offset: this.#value<Vector3>('offset').map((by) => by * amount) as unknown as Vector3 };
    }
  }

  /** Returns the parsed value of a property, which may be text or numbers. @param unit Unit of numbers. */
  #value<T>(name: Name, unit = ''): T {
    const value: unknown = this[name];
    const written =
      typeof value === 'object' && value !== null
        ? Array.from(value as ArrayLike<number>, (each) => `${each}${unit}`).join(' ')
        : typeof value === 'number'
          ? `${value}${unit}`
          : (value as string | null);
    const grammar = CUT_ATTRIBUTES[name].grammar as AttributeGrammar<unknown>;
    return readAttribute(name, written, grammar, (sentence) => {
      const own = sentence.replace('<gaussian-splat>', '<splat-cut>');
      if (!this.#warned.has(own)) console.warn(own);
      this.#warned.add(own);
    }) as T;
  }
}

// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export interface SplatCutElement extends PropertiesOf<typeof CUT_ATTRIBUTES> {}

declare global {
  interface HTMLElementTagNameMap {
    'splat-cut': SplatCutElement;
  }
}
