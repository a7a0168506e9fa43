import type { PropertyDeclarations } from 'lit';
import type { Attributes } from '../../viewer/attributes.js';
import type { Source } from '../../viewer/element-host.js';
import { CONTROL_PREFIX, readControls, readNumbers, type ControlValues } from '../../sources/generator/values.js';
import type { SplatMethods, Splats } from '../../sources/splats/splat-input.js';
import type { GeneratorInput } from '../../sources/generator/inputs.js';
import type { DynamicState } from '../../sources/generator/dynamic-model.js';
import type { PropertiesOf } from '../../viewer/attribute.js';
import { SCENE_ATTRIBUTES } from './attributes.js';
import { childDeclarations, SplatChild, type ChildPlace } from './child.js';

type Properties = PropertiesOf<typeof SCENE_ATTRIBUTES>;

/**
 * A scene among others, as a child of `<gaussian-splat>`. The splats of all scenes are sorted together and occlude one
 * another.
 *
 * ```html
 * <gaussian-splat src="room.sog">
 *   <splat-scene src="plant.spz" position="1.2m 0 0" rotation="0 90deg 0" scale="0.5"></splat-scene>
 * </gaussian-splat>
 * ```
 *
 * @tagname splat-scene
 * @fires {CustomEvent<LoadDetail>} load - Fired when the scene is shown.
 * @fires {ProgressEvent} progress - Fired when bytes have arrived.
 * @fires {CustomEvent<ElementError>} error - Fired when the scene cannot be shown; `detail` is the same object as the
 * property `error`. Other scenes and meshes stay.
 * @fires {Event} inputs-change - Fired when the inputs that the page may set change; `inputs` contains them.
 * @fires {CustomEvent<GeneratorMemoryDetail>} generator-memory - Fired once before the first run of the scene's
 * generator; `detail` contains the memory that is known by then.
 * @fires {CustomEvent<ElementError>} generator-error - Fired when a run of the scene's generator fails; the last good
 * frame stays.
 * @fires {ScenePointerEvent} click - With `interactive`: fired when a visitor clicks the scene, by pointer or key.
 * Bubbles.
 * @fires {ScenePointerEvent} pointerover - With `interactive`: fired when the pointer enters the scene. Bubbles.
 * @fires {ScenePointerEvent} pointerout - With `interactive`: fired when the pointer leaves the scene. Bubbles.
 * @fires {Event} play - Same as on HTMLMediaElement: fired when the scene's own clock starts.
 * @fires {Event} pause - Fired when the scene's own clock stops.
 * @fires {Event} ended - Fired when the scene's own clock reaches the end.
 */
export class SplatSceneElement extends SplatChild {
  static override properties: PropertyDeclarations = {
    ...childDeclarations(SCENE_ATTRIBUTES),
    splats: { attribute: false },
    inputValues: { attribute: false },
  };

  declare src: Properties['src'];
  declare up: Properties['up'];
  declare opacity: Properties['opacity'];
  declare crop: Properties['crop'];
  declare contract: Properties['contract'];
  declare chain: Properties['chain'];
  declare pose: Properties['pose'];
  declare groups: Properties['groups'];
  declare groupNames: Properties['groupNames'];

  /** Splats that the page shows instead of `src`, as on `<gaussian-splat>`; null for none. */
  declare splats: Splats | null;

  /**
   * Values of a generator's controls by the names of its inputs. They override the attributes `control-NAME`. Set a new
   * object to change values.
   */
  declare inputValues: ControlValues | null;
  /** Replaces values of some of these splats, as on `<gaussian-splat>`; undefined before they are shown. */
  declare updateSplats: SplatMethods['updateSplats'];
  protected readonly table = SCENE_ATTRIBUTES;
  #dynamicValues: Omit<DynamicState, 'timeSeconds'> | undefined;
  #observer: MutationObserver | undefined;

  /**
   * Inputs of the scene's generators that the page may set, as on `<gaussian-splat>`. The event `inputs-change` reports
   * changes.
   */
  get inputs(): readonly GeneratorInput[] {
    return this.entry.inputs;
  }

  /** @internal */
  override get dynamicValues(): Omit<DynamicState, 'timeSeconds'> {
    return (this.#dynamicValues ??= this.#readDynamicValues());
  }

  /** @internal */
  override get overrides(): Partial<Attributes> {
    return { ...super.overrides, groups: this.groups };
  }

  /** @internal */
  get source(): Source {
    return { src: this.src, splats: this.splats, contract: this.contract, chain: this.chain, postprocess: null };
  }

  override connectedCallback(): void {
    super.connectedCallback();
    // Attributes `control-NAME` are observed here: the model defines their names, so `observedAttributes` cannot list
    // them.
    this.#observer ??= new MutationObserver((records) => {
      if (!records.some(({ attributeName }) => attributeName?.startsWith(CONTROL_PREFIX))) return;
      this.requestUpdate();
      this.#dynamicValues = undefined;
      this.entry.requestFrame();
    });
    this.#observer.observe(this, { attributes: true });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#observer?.disconnect();
  }

  protected override willUpdate(): void {
    super.willUpdate();
    this.#dynamicValues = undefined;
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

  #readDynamicValues(): Omit<DynamicState, 'timeSeconds'> {
    const pose = readNumbers(this.pose);
    if (pose === undefined && this.pose) this.warn('<splat-scene>: pose expects numbers; the rest pose is used.');
    return { pose, ...readControls(this.attributes, this.inputValues, (sentence) => this.warn(sentence)) };
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'splat-scene': SplatSceneElement;
  }
}
