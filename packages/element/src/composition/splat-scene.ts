import type { PropertyDeclarations } from 'lit';
import type { Source } from '../stage-host.js';
import { CONTROL_PREFIX, readControls, readNumbers, type ControlValues } from '../live/values.js';
import type { GeneratorInput } from '../live/inputs.js';
import type { LiveState } from '../live/live-model.js';
import { SCENE_ATTRIBUTES, type PropertiesOf } from './attributes.js';
import { childDeclarations, SplatChild, type ChildPlace } from './child.js';

type Properties = PropertiesOf<typeof SCENE_ATTRIBUTES>;

/**
 * A scene among others, as a child of `<gaussian-splat>`: all of them are sorted together and hide one another.
 *
 * ```html
 * <gaussian-splat src="room.sog">
 *   <splat-scene src="plant.spz" position="1.2m 0 0" rotation="0 90deg 0" scale="0.5"></splat-scene>
 * </gaussian-splat>
 * ```
 *
 * @tagname splat-scene
 * @fires {CustomEvent<LoadDetail>} load - It is shown.
 * @fires {ProgressEvent} progress - Bytes have arrived.
 * @fires {CustomEvent<ElementError>} error - It cannot be shown; `detail` is the same object as the property `error`. The others stay.
 * @fires {Event} inputs-change - The inputs that the page may set are others; `inputs` has them.
 * @fires {CustomEvent<ElementError>} generator-error - A run of its generator failed; the last good frame stays.
 * @fires {ScenePointerEvent} click - With `interactive`: a visitor has clicked it, by pointer or key. Bubbles.
 * @fires {ScenePointerEvent} pointerover - With `interactive`: the pointer has come over it. Bubbles.
 * @fires {ScenePointerEvent} pointerout - With `interactive`: the pointer has left it. Bubbles.
 * @fires {Event} play - As of HTMLMediaElement: its own clock runs.
 * @fires {Event} pause - Its own clock stands still.
 * @fires {Event} ended - Its own clock has come to its end.
 */
export class SplatSceneElement extends SplatChild {
  static override properties: PropertyDeclarations = {
    ...childDeclarations(SCENE_ATTRIBUTES),
    inputValues: { attribute: false },
  };

  declare src: Properties['src'];
  declare up: Properties['up'];
  declare opacity: Properties['opacity'];
  declare crop: Properties['crop'];
  declare contract: Properties['contract'];
  declare chain: Properties['chain'];
  declare pose: Properties['pose'];

  /** Controls of a generator by the names of its inputs; above the attributes `control-NAME`. New values are a new object. */
  declare inputValues: ControlValues | null;
  protected readonly table = SCENE_ATTRIBUTES;
  #liveValues: Omit<LiveState, 'timeSeconds'> | undefined;
  #observer: MutationObserver | undefined;

  /** What the page may set of its generators, as of `<gaussian-splat>`; `inputs-change` tells of others. */
  get inputs(): readonly GeneratorInput[] {
    return this.holder.inputs;
  }

  /** @internal */
  override get liveValues(): Omit<LiveState, 'timeSeconds'> {
    return (this.#liveValues ??= this.#readLiveValues());
  }

  /** @internal */
  get source(): Source {
    return { src: this.src, contract: this.contract, chain: this.chain, postprocess: null };
  }

  override connectedCallback(): void {
    super.connectedCallback();
    // Names of controls are the model's: no list of observed attributes can hold them.
    this.#observer ??= new MutationObserver((records) => {
      if (!records.some(({ attributeName }) => attributeName?.startsWith(CONTROL_PREFIX))) return;
      this.requestUpdate();
      this.#liveValues = undefined;
      this.holder.requestFrame();
    });
    this.#observer.observe(this, { attributes: true });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#observer?.disconnect();
  }

  protected override willUpdate(): void {
    super.willUpdate();
    this.#liveValues = undefined;
  }

  protected override readPlace(): ChildPlace {
    const corners = this.read<readonly number[] | undefined>('crop', this.crop);
    return {
      ...super.readPlace(),
      up: this.read('up', this.up),
      opacity: this.read('opacity', this.opacity),
      crop: corners && { min: corners.slice(0, 3) as never, max: corners.slice(3) as never },
    };
  }

  #readLiveValues(): Omit<LiveState, 'timeSeconds'> {
    const pose = readNumbers(this.pose);
    if (pose === undefined && this.pose) this.warn('<splat-scene>: pose expects numbers; the rest pose counts.');
    return { pose, ...readControls(this.attributes, this.inputValues, (sentence) => this.warn(sentence)) };
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'splat-scene': SplatSceneElement;
  }
}
