/** The panel of controls. The module is loaded only for the attribute `controls-panel`, if a model has inputs. */
import { css, type ReactiveElement } from 'lit';
import { adoptStyles } from '../../viewer/styles.js';
import type { A11yStrings } from '../../viewer/strings.js';
import type { GeneratorInput } from './inputs.js';
import { poseOf, turnsOf } from './pose-of.js';
import { readNumbers, valueOf, type ControlValues, type Numbers } from './values.js';

/** Texts of the panel in English. Their keys are also keys of `a11y`. */
export const PANEL_WORDS = {
  'controls-panel': 'Controls',
  'controls-reset': 'Reset',
  'controls-time': 'Time',
  'controls-joint': 'Joint',
  'controls-group': 'Scene',
} as const;

/** Maximum number of sliders for one input. The page can set the remaining elements of larger inputs. */
const MAX_SLIDERS = 24;
/** Range of coefficients for which the contract declares none, in standard deviations of body shapes. */
const SHAPE_RANGE = [-3, 3] as const;
const SLIDER_STEPS = 200;
/** The formats of images that inputs accept: see input-images.ts. */
const IMAGES = 'image/png, image/jpeg, image/webp, image/avif';
const SLIDES = ['control', 'shape'];

const STYLES = css`
  [part='controls-panel'] {
    position: absolute;
    inset-block-start: 8px;
    inset-inline-end: 8px;
    box-sizing: border-box;
    inline-size: min(17em, 45%);
    max-block-size: calc(100% - 16px);
    overflow: auto;
    padding: 0.5em 0.75em;
    border-radius: 6px;
    background: var(--message-background, rgb(255 255 255 / 0.92));
    color: var(--message-color, rgb(30 30 30));
    font: var(--message-font, 0.875rem/1.4 system-ui, sans-serif);
  }
  [part='controls-panel'] summary {
    cursor: pointer;
    min-block-size: 24px;
  }
  [part='controls-group'] {
    margin: 0.5em 0 0;
    padding: 0;
    border: 0;
    min-inline-size: 0;
  }
  [part='controls-group'] legend {
    padding: 0;
    font-weight: 600;
  }
  [part='control'] {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: 0 0.5em;
    margin-block: 0.4em;
  }
  [part='control-input'] {
    grid-column: 1 / -1;
    inline-size: 100%;
    min-block-size: 24px;
    box-sizing: border-box;
  }
  [part='control-value'] {
    font-variant-numeric: tabular-nums;
  }
`;

/** The element that inputs belong to: `<gaussian-splat>`, or a `<splat-scene>` in it. */
interface Owner extends HTMLElement, Pick<ReactiveElement, 'addController'> {
  readonly inputs: readonly GeneratorInput[];
  inputValues: ControlValues | null;
  pose: Numbers | null;
}

type Pose = Numbers | null | undefined;

/** Interface of the element for the panel. */
interface PanelHost extends Owner {
  readonly controlsPanel: boolean;
  /** `strings`: the words of the page, and those of its language as soon as they are loaded. */
  readonly core: { readonly strings: A11yStrings };
  readonly duration: number;
  currentTime: number;
}

const panels = new WeakMap<PanelHost, ControlsPanel>();

/** A panel of controls for visitors, which is generated from the inputs of the current models. */
export class ControlsPanel {
  readonly #element: PanelHost;
  readonly #box: HTMLElement;
  /**
   * Poses with joint rotations, which visitors edit as axis-angle. `given` is the pose that the page has set, and
   * `last` is the last one that was read or edited.
   */
  readonly #poses = new Map<Owner, { given: Pose; last: Pose }>();
  /** Owners that the panel observes for changes of their values. */
  readonly #followed = new WeakSet<Owner>();
  /** Functions that set each control to its current value. */
  #followers: (() => void)[] = [];
  #reported = '';

  private constructor(element: PanelHost) {
    this.#element = element;
    this.#box = make('section', { part: 'controls-panel' });
    const root = element.shadowRoot!;
    adoptStyles(root, STYLES);
    root.append(this.#box);
    element.addEventListener('inputs-change', () => this.#update());
    element.addEventListener('timeupdate', () => this.#follow());
    element.addEventListener('emptied', () => this.#update());
    // An element is also updated when its words change.
    element.addController({ hostUpdated: () => this.#update() });
    // Observes removals, because the events of a removed child do not reach the element. Its controls disappear.
    new MutationObserver(() => this.#update()).observe(element, {
      attributeFilter: ['controls-panel'],
      childList: true,
    });
  }

  /** Shows or updates the panel of an element. The first call creates it. */
  static show(element: PanelHost): void {
    const panel = panels.get(element) ?? new ControlsPanel(element);
    panels.set(element, panel);
    panel.#update();
  }

  /** Rebuilds the controls if their set or their words have changed. */
  #update(): void {
    const owners = this.#owners;
    this.#box.hidden = !this.#element.controlsPanel || owners.length === 0;
    const { strings } = this.#element.core;
    const reported = JSON.stringify([strings, owners.map((owner) => [this.#titleOf(owner), owner.inputs])]);
    if (reported === this.#reported || this.#box.hidden) return;
    this.#reported = reported;
    this.#followers = [];
    for (const owner of owners) {
      // Controls also show values that the page sets.
      if (!this.#followed.has(owner)) owner.addController({ hostUpdated: () => this.#follow() });
      this.#followed.add(owner);
    }
    const controls = owners.flatMap((owner) => {
      const own = owner.inputs.flatMap((input) => this.#controlsOf(owner, input));
      return owner === this.#element || own.length === 0 ? own : [this.#group(owner, own)];
    });
    const takesTime = owners.some(({ inputs }) => inputs.some(({ role }) => role === 'time'));
    if (takesTime && Number.isFinite(this.#element.duration)) controls.unshift(this.#time());
    const title = this.#word('controls-panel');
    this.#box.setAttribute('aria-label', title);
    if (Object.keys(strings).length === 0) this.#box.lang = 'en';
    else this.#box.removeAttribute('lang');
    const details = make('details', {});
    details.open = true;
    const summary = make('summary', { textContent: title });
    const reset = make('button', { type: 'button', part: 'control-input', textContent: this.#word('controls-reset') });
    reset.addEventListener('click', () => this.#reset());
    details.append(summary, ...controls, reset);
    this.#box.replaceChildren(details);
    this.#box.hidden = controls.length === 0;
  }

  #follow(): void {
    for (const follow of this.#followers) follow();
  }

  /** Returns a slider that follows its value, because other code may set the value, too. */
  #slider(...[title, range, step, now, onValue]: Parameters<typeof slider>): HTMLElement {
    const control = slider(title, range, step, now, onValue);
    this.#followers.push(() => showValue(control, now()));
    return control;
  }

  /** The element and its children, as far as they have inputs. */
  get #owners(): readonly Owner[] {
    const children = [...this.#element.children] as Element[] as Owner[];
    return [this.#element, ...children].filter(({ inputs = [] }) => inputs.length > 0);
  }

  /** Returns the name of a child for visitors: its title, its id, or its number from 1. */
  #titleOf(owner: Owner): string {
    return (
      owner.title || owner.id || `${this.#word('controls-group')} ${[...this.#element.children].indexOf(owner) + 1}`
    );
  }

  #group(owner: Owner, controls: readonly HTMLElement[]): HTMLElement {
    const group = make('fieldset', { part: 'controls-group' });
    group.append(make('legend', { textContent: this.#titleOf(owner) }), ...controls);
    return group;
  }

  #controlsOf(owner: Owner, input: GeneratorInput): HTMLElement[] {
    if (SLIDES.includes(input.role)) return this.#sliders(owner, input);
    if (input.role === 'image') return [this.#image(owner, input)];
    return input.role === 'pose' ? this.#pose(owner, input) : [];
  }

  #sliders(owner: Owner, input: GeneratorInput): HTMLElement[] {
    const { name, label, size, range = SHAPE_RANGE, step = (range[1] - range[0]) / SLIDER_STEPS, names } = input;
    const initial = numbersOf(input);
    return Array.from({ length: Math.min(size, MAX_SLIDERS) }, (_, i) => {
      const title = names?.[i] ?? (size > 1 ? `${label} ${i + 1}` : label);
      const now = (): readonly number[] => valuesOf(owner, name) ?? initial;
      const valueAt = (k: number): number => now()[k] ?? now()[0];
      const own = (): number => valueAt(i);
      return this.#slider(title, range, step, own, (value) => {
        const values = Array.from({ length: size }, (__, k) => (k === i ? value : valueAt(k)));
        set(owner, name, values);
      });
    });
  }

  #image(owner: Owner, { name, label, views = 1 }: GeneratorInput): HTMLElement {
    const field = make('input', { type: 'file', accept: IMAGES, multiple: views > 1, part: 'control-input' });
    field.addEventListener('change', () => {
      const files = [...(field.files ?? [])].slice(0, views);
      if (files.length === views) set(owner, name, views > 1 ? files : files[0]);
    });
    return labeled(label, field);
  }

  /** Returns controls to select a joint and to rotate it about its three axes; none for poses in another format. */
  #pose(owner: Owner, input: GeneratorInput): HTMLElement[] {
    const { name, label, joints, size } = input;
    const perJoint = numbersPerJoint(input);
    if (perJoint === 0) return [];
    const count = size / perJoint;
    const pose = this.#poses.get(owner) ?? { given: owner.pose, last: owner.pose };
    this.#poses.set(owner, pose);
    // The property has the numbers of all poses of the model, in the order of its inputs.
    const poses = owner.inputs.filter(({ role }) => role === 'pose');
    const start = poses.slice(0, poses.indexOf(input)).reduce((sum, other) => sum + other.size, 0);
    const whole = (): number[] => {
      const [numbers, rest] = [readNumbers(owner.pose), poses.flatMap(restOf)];
      return numbers?.length === rest.length ? numbers : rest;
    };
    const now = (): readonly number[] => valuesOf(owner, name) ?? whole().slice(start, start + size);
    let turns = turnsOf(now(), input);
    /**
     * Returns the current rotations as axis-angle, radians. Rotations that a visitor has edited are not read from the
     * pose, which does not preserve full turns.
     */
    const read = (): number[] => {
      if (owner.pose !== pose.last) pose.given = pose.last = owner.pose;
      if (String(now()) !== String(poseOf(turns, input))) turns = turnsOf(now(), input);
      return turns;
    };
    const write = (numbers: readonly number[]): void => {
      if (valuesOf(owner, name)) set(owner, name, numbers);
      else owner.pose = pose.last = whole().toSpliced(start, size, ...numbers);
    };
    const choice = make('select', { part: 'control-input' });
    choice.append(
      ...Array.from({ length: count }, (_, i) =>
        make('option', { value: String(i), textContent: joints?.[i] ?? `${this.#word('controls-joint')} ${i + 1}` }),
      ),
    );
    const axes = ['x', 'y', 'z'].map((axis, k) => {
      const place = (): number => 3 * Number(choice.value) + k;
      return this.#slider(
        axis,
        [-Math.PI, Math.PI],
        Math.PI / SLIDER_STEPS,
        () => read()[place()],
        (value) => {
          read()[place()] = value;
          write(poseOf(turns, input));
        },
      );
    });
    choice.addEventListener('change', () => this.#follow());
    return [labeled(poses.length > 1 ? label : this.#word('controls-joint'), choice), ...axes];
  }

  #time(): HTMLElement {
    const element = this.#element;
    const { duration } = element;
    const now = (): number => element.currentTime;
    return this.#slider(this.#word('controls-time'), [0, duration], duration / 1000, now, (value) => {
      element.currentTime = value;
    });
  }

  #reset(): void {
    for (const owner of this.#owners) {
      const names = owner.inputs.map(({ name }) => name);
      const others = Object.entries(owner.inputValues ?? {}).filter(([name]) => !names.includes(name));
      owner.inputValues = others.length > 0 ? Object.fromEntries(others) : null;
      const pose = this.#poses.get(owner);
      if (pose) owner.pose = pose.last = pose.given ?? null;
    }
    this.#reported = '';
    this.#update();
    this.#box.querySelector('summary')?.focus();
  }

  #word(key: keyof typeof PANEL_WORDS): string {
    return (this.#element.core.strings as Readonly<Record<string, string | undefined>>)[key] ?? PANEL_WORDS[key];
  }
}

/** Returns the numbers of an input that a property or an attribute sets; undefined if neither does. */
function valuesOf(owner: Owner, name: string): readonly number[] | undefined {
  const found = valueOf(owner.inputValues ?? {}, name);
  return readNumbers((found as Numbers | undefined) ?? owner.getAttribute(`control-${name.toLowerCase()}`));
}

function set(owner: Owner, name: string, value: ControlValues[string]): void {
  owner.inputValues = { ...owner.inputValues, [name]: value };
}

const numbersPerJoint = ({ format = 'parameters' }: GeneratorInput): number =>
  ({ 'axis-angle': 3, quaternion: 4, matrix: 9, parameters: 0 })[format];

/** Returns the pose of an input that no page sets: its default, else no rotation. */
function restOf(input: GeneratorInput): readonly number[] {
  if (Array.isArray(input.default)) return input.default as readonly number[];
  const perJoint = numbersPerJoint(input);
  if (perJoint === 0) return new Array<number>(input.size).fill(0);
  return poseOf(new Array<number>((3 * input.size) / perJoint).fill(0), input);
}

/** Returns the default value of an input as a list. */
const numbersOf = ({ default: initial = 0 }: GeneratorInput): readonly number[] =>
  typeof initial === 'number' ? [initial] : initial;

function slider(
  title: string,
  [min, max]: readonly [min: number, max: number],
  step: number,
  now: () => number,
  onValue: (value: number) => void,
): HTMLElement {
  const field = make('input', { type: 'range', part: 'control-input' });
  Object.assign(field, { min: String(min), max: String(max), step: String(step) });
  // Not an `<output>` element, because a label applies to the first labelable element in it. Screen readers read the
  // value of the range itself.
  const shown = make('span', { part: 'control-value', ariaHidden: 'true' });
  const control = labeled(title, field, shown);
  field.addEventListener('input', () => {
    const value = field.valueAsNumber;
    shown.textContent = short(value);
    // If the minimum is not a multiple of the step, rounding can make the value near zero instead of zero.
    onValue(Math.abs(value) < step / 1e6 ? 0 : value);
  });
  showValue(control, now());
  return control;
}

function showValue(control: HTMLElement, value: number): void {
  control.querySelector('input')!.value = String(value);
  control.querySelector('[part=control-value]')!.textContent = short(value);
}

function labeled(title: string, ...fields: HTMLElement[]): HTMLElement {
  const control = make('label', { part: 'control' });
  const [field, ...shown] = fields;
  control.append(make('span', { part: 'control-label', textContent: title }), ...shown, field);
  return control;
}

const short = (value: number): string => String(Number((Math.abs(value) < 1e-6 ? 0 : value).toPrecision(3)));

function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Readonly<Record<string, string | boolean>>,
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  const { part, ...others } = properties;
  if (typeof part === 'string') element.setAttribute('part', part);
  return Object.assign(element, others);
}
