import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { InputOptions } from './controllers/input-controller.js';
import { prefersReducedMotion } from './controllers/motion-controller.js';
import type { GaussianSplatEventMap } from './events.js';
import { FrameScheduler } from './gpu/frame-scheduler.js';
import { defaultMemoryBudget } from './gpu/memory-budget.js';
import type { Services, StageHost } from './stage-host.js';
import { windowOf } from './controllers/size-controller.js';
import type { SpokenStrings } from './words.js';

/** What the page says of an element, as of now, and what it is told: the part of the stage that no controller has a hand in. */
export class ElementCore implements StageHost {
  readonly element: ReactiveControllerHost & HTMLElement;
  readonly #host: StageHost;

  constructor(element: ReactiveControllerHost & HTMLElement, host: StageHost) {
    this.element = element;
    this.#host = host;
  }

  get attributes(): Attributes {
    return this.#host.attributes;
  }

  get services(): Services {
    return this.#host.services;
  }

  get input(): InputOptions {
    return this.#host.input;
  }

  get strings(): SpokenStrings {
    return this.#host.strings;
  }

  get views(): StageHost['views'] {
    return this.#host.views;
  }

  get liveValues(): StageHost['liveValues'] {
    return this.#host.liveValues;
  }

  get loops(): boolean {
    return this.#host.loops;
  }

  get autoplays(): boolean {
    return this.#host.autoplays;
  }

  get autoRotates(): boolean {
    return this.#host.autoRotates;
  }

  get startTime(): number {
    return this.#host.startTime;
  }

  get canvas(): HTMLCanvasElement | null {
    return this.#host.canvas;
  }

  get surface(): HTMLElement | null {
    return this.#host.surface;
  }

  get hotspotLayer(): HTMLElement | null {
    return this.#host.hotspotLayer;
  }

  get isConnected(): boolean {
    return this.element.isConnected;
  }

  get scheduler(): FrameScheduler {
    return FrameScheduler.of(windowOf(this.element));
  }

  get memoryBudget(): number | undefined {
    return this.services.memoryBudget ?? defaultMemoryBudget();
  }

  get decayMs(): number {
    return prefersReducedMotion() ? 0 : this.attributes.interpolationDecay;
  }

  warn(sentence: string): void {
    this.#host.warn(sentence);
  }

  dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void {
    this.element.dispatchEvent(event);
  }
}
