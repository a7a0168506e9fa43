import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { Attributes } from '../attributes.js';
import type { CameraController } from './camera-controller.js';
import type { Mover } from './motion.js';

export interface PromptHost {
  readonly attributes: Pick<Attributes, 'interactionPromptThreshold'>;
  readonly camera: Pick<CameraController, 'turnBy'>;
  /** True where a prompt makes sense: the scene is on show, and people can move it. */
  readonly mayPrompt: boolean;
  /** Whether the camera moves to and fro with it. */
  readonly promptWiggles: boolean;
  requestFrame(): void;
}

/** How far the camera goes to either side, radians. */
const WIGGLE_ANGLE = Math.PI / 18;
/** Once to and fro, twice over; then the prompt stands still: less than 5 s, so that nobody has to look for a way to stop it. */
const WIGGLE_MS = 4_500;
/** Then it has been seen. */
const SHOWN_MS = 5_000;

/** Turn of the camera at a moment of the wiggle, radians: 0 at its start and its end. */
export function wiggleAt(elapsedMs: number): number {
  if (elapsedMs <= 0 || elapsedMs >= WIGGLE_MS) return 0;
  const share = elapsedMs / WIGGLE_MS;
  return WIGGLE_ANGLE * Math.sin(4 * Math.PI * share) * Math.sin(Math.PI * share);
}

/** Shows people who have not touched the scene that they can. */
export class PromptController implements ReactiveController, Mover {
  readonly #host: ReactiveControllerHost;
  readonly #of: PromptHost;
  #state: 'idle' | 'waiting' | 'shown' | 'done' = 'idle';
  #timer: ReturnType<typeof setTimeout> | undefined;
  #start: number | undefined;
  #turned = 0;

  constructor(host: ReactiveControllerHost, of: PromptHost) {
    this.#host = host;
    this.#of = of;
    host.addController(this);
  }

  get isShown(): boolean {
    return this.#state === 'shown';
  }

  hostUpdated(): void {
    const mayShow = this.#of.mayPrompt;
    if (mayShow && this.#state === 'idle') this.#wait();
    else if (!mayShow && (this.#state === 'waiting' || this.#state === 'shown')) this.reset();
  }

  hostDisconnected(): void {
    if (this.#state !== 'done') this.#set('idle');
  }

  /** A person has moved the camera, or has seen it long enough, and needs no prompt any more. */
  dismiss(): void {
    if (this.#state !== 'done') this.#set('done');
  }

  /** As if nobody had touched the scene yet. */
  reset(): void {
    this.#set('idle');
  }

  advance(now: number): boolean {
    if (this.#state !== 'shown' || !this.#of.promptWiggles) return false;
    this.#start ??= now;
    const elapsed = now - this.#start;
    const turned = wiggleAt(elapsed);
    if (turned !== this.#turned) this.#turned += this.#of.camera.turnBy(turned - this.#turned);
    return elapsed < WIGGLE_MS;
  }

  #wait(): void {
    this.#state = 'waiting';
    this.#timer = setTimeout(() => {
      this.#start = undefined;
      this.#turned = 0;
      this.#set('shown');
      this.#timer = setTimeout(() => this.dismiss(), SHOWN_MS);
      if (this.#of.promptWiggles) this.#of.requestFrame();
    }, this.#of.attributes.interactionPromptThreshold);
  }

  #set(state: 'idle' | 'shown' | 'done'): void {
    clearTimeout(this.#timer);
    const changed = state !== this.#state;
    this.#state = state;
    if (changed) this.#host.requestUpdate();
  }
}
