import type { Attributes } from './attributes.js';
import { limited } from '../gpu/memory-budget.js';
import type { SceneRequest } from '../loading/protocol.js';
import { Addresses } from './source-request.js';
import type { Services, Source } from './element-host.js';
import type { SceneController } from './scene-controller.js';

export interface SourceHost {
  readonly attributes: Attributes;
  readonly services: Services;
  /** Maximum GPU memory of the scene, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  readonly scene: Pick<SceneController, 'want' | 'see' | 'isOther'>;
  /** `isInSight`: whether the scene would be visible if it were loaded. */
  readonly core: { readonly isInSight: boolean } | undefined;
  /** Whether the element is in the page. An element outside the page requests no scene. */
  readonly isConnected: boolean;
}

/** Determines the source from the attributes, and whether it may be loaded yet. */
export class SourceController {
  readonly #host: SourceHost;
  #source: Source = { src: null, contract: null, chain: null, postprocess: null };
  #addresses = new Addresses();
  /** Whether a script plays the scene, or waits until it can be played. The scene is then loaded even off-screen. */
  #isWanted = false;

  constructor(host: SourceHost) {
    this.#host = host;
  }

  /** Sets the source. May be called after every update: only changes have an effect. */
  set(source: Source): void {
    this.#source = source;
    this.request();
  }

  /** Sets whether the scene is loaded even if it is off-screen. Takes effect with the next {@link request}. */
  needNow(isWanted: boolean): void {
    this.#isWanted = isWanted;
  }

  /** Discards the resolved addresses, so that the next request resolves all of them again. */
  renew(): void {
    this.#addresses = new Addresses();
  }

  /** Requests the scene of the current source. Loading starts if the source is eager, visible or needed by a script. */
  request(): void {
    const { attributes, core, isConnected, scene } = this.#host;
    const request = this.#requestOf(this.#source);
    // A script that plays the scene does not load the one that replaces it.
    if (isConnected) scene.want(request, false);
    const isSeen = this.#isWanted || core!.isInSight;
    if (isConnected) scene.want(request, attributes.loading === 'eager' || isSeen);
    scene.see(isSeen);
  }

  /** Returns whether a source requests another scene than the last request. */
  isOther(source: Source): boolean {
    return this.#host.scene.isOther(this.#requestOf(source));
  }

  /** Addresses of the post-processors of the current source. */
  get postprocess(): readonly string[] {
    return this.#addresses.postprocess(this.#source.postprocess, this.#host.services.urlModifier);
  }

  #requestOf(source: Source): SceneRequest | null {
    const { attributes, services } = this.#host;
    const { sceneLimits, urlModifier } = services;
    const request = this.#addresses.request(source, attributes, urlModifier);
    return request && limited({ ...request, limits: sceneLimits }, this.#host.memoryBudget);
  }
}
