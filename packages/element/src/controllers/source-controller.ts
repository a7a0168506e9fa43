import type { Attributes } from '../attributes.js';
import type { SceneRequest } from '../loading/protocol.js';
import { Addresses } from '../source-request.js';
import type { Services, Source } from '../element-host.js';
import type { SceneController } from './scene-controller.js';

export interface SourceHost {
  readonly attributes: Attributes;
  readonly services: Services;
  readonly scene: Pick<SceneController, 'want' | 'see' | 'isOther'>;
  /** Whether the scene would be visible. */
  readonly isInSight: boolean;
  /** Whether the element is in the page: others request nothing. */
  readonly isConnected: boolean;
}

/** Determines the source from the attributes, and whether it may be loaded yet. */
export class SourceController {
  readonly #host: SourceHost;
  #source: Source = { src: null, contract: null, chain: null, postprocess: null };
  #addresses = new Addresses();
  /** Whether a script plays the scene, or waits to: then it is loaded even off-screen. */
  #isWanted = false;

  constructor(host: SourceHost) {
    this.#host = host;
  }

  /** Called after every update; only changes have an effect. */
  set(source: Source): void {
    this.#source = source;
    this.request();
  }

  /** Loads the scene even if it is off-screen, until another is requested. */
  needNow(isWanted: boolean): void {
    this.#isWanted = isWanted;
  }

  /** Resolves addresses again, as if all had just been set. */
  renew(): void {
    this.#addresses = new Addresses();
  }

  /** Requests the current scene, and its bytes if loading may start. */
  request(): void {
    const { attributes, isInSight, isConnected, scene } = this.#host;
    const isSeen = this.#isWanted || isInSight;
    if (isConnected) scene.want(this.#requestOf(this.#source), attributes.loading === 'eager' || isSeen);
    scene.see(isSeen);
  }

  /** Whether a source requests another scene than the current or loading one. */
  isOther(source: Source): boolean {
    return this.#host.scene.isOther(this.#requestOf(source));
  }

  /** Addresses of the post-processors of the last source. */
  get postprocess(): readonly string[] {
    return this.#addresses.postprocess(this.#source.postprocess, this.#host.services.urlModifier);
  }

  #requestOf(source: Source): SceneRequest | null {
    const { attributes, services } = this.#host;
    const { sceneLimits, urlModifier } = services;
    const request = this.#addresses.request(source, attributes, urlModifier);
    return request && { ...request, limits: sceneLimits };
  }
}
