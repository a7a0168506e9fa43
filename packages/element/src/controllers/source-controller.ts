import type { Attributes } from '../attributes.js';
import type { SceneRequest } from '../loading/protocol.js';
import { Addresses } from '../source-request.js';
import type { Services, Source } from '../stage-host.js';
import type { SceneController } from './scene-controller.js';

export interface SourceHost {
  readonly attributes: Attributes;
  readonly services: Services;
  readonly scene: Pick<SceneController, 'want' | 'see' | 'isOther'>;
  /** Somebody would see the scene. */
  readonly isInSight: boolean;
  /** Whether an element is in the page: those that are not ask for nothing. */
  readonly isConnected: boolean;
}

/** What the attributes ask for, and whether it may be loaded yet. */
export class SourceController {
  readonly #host: SourceHost;
  #source: Source = { src: null, contract: null, chain: null, postprocess: null };
  #addresses = new Addresses();
  /** A script plays the scene, or waits to: it is loaded wherever it is. */
  #isWanted = false;

  constructor(host: SourceHost) {
    this.#host = host;
  }

  /** Called after every update; only changes act. */
  set(source: Source): void {
    this.#source = source;
    this.request();
  }

  /** Loads the scene although nobody may see it, until another is wanted. */
  needNow(isWanted: boolean): void {
    this.#isWanted = isWanted;
  }

  /** Addresses are found anew, as if all had just been set. */
  renew(): void {
    this.#addresses = new Addresses();
  }

  /** Asks for the scene of now, and for its bytes if it is time. */
  request(): void {
    const { attributes, isInSight, isConnected, scene } = this.#host;
    const isSeen = this.#isWanted || isInSight;
    if (isConnected) scene.want(this.#requestOf(this.#source), attributes.loading === 'eager' || isSeen);
    scene.see(isSeen);
  }

  /** Whether a source asks for another scene than the one that is shown or loaded. */
  isOther(source: Source): boolean {
    return this.#host.scene.isOther(this.#requestOf(source));
  }

  /** Addresses of the post-processors that the last source names. */
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
