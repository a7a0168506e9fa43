import type { GeneratorModel } from './open-model.js';

/**
 * How often a model has something new to compute: `once`, if it takes no input; `chosen`, if its inputs are images and what a person sets beside them;
 * `continuous`, if a clock, a camera, a pose or another model may change an input for each frame.
 */
export type Cadence = 'once' | 'chosen' | 'continuous';

/** Inputs that change when a person chooses something else. */
const CHOSEN: ReadonlySet<string> = new Set(['image', 'control', 'shape', 'seed']);

/** The cadence of a model, from the roles of its inputs. A post-processor's image is a frame: it is continuous. */
export function cadenceOf({ contract, layout }: Pick<GeneratorModel, 'contract' | 'layout'>): Cadence {
  const roles = Object.values(contract.inputs).map(({ role }) => role);
  if (layout === undefined) return 'continuous';
  if (roles.length === 0) return 'once';
  return roles.includes('image') && roles.every((role) => CHOSEN.has(role)) ? 'chosen' : 'continuous';
}

/** Bytes of weights from which a session is released while nothing changes: less are not worth another start. */
const LARGE_BYTES = 16 * 2 ** 20;
/** From the last run until the release, ms. */
const REST_MS = 5_000;

/** Releases the session of a model that has nothing to compute, with its weights, when no run has followed the last one for a while. */
export class WeightRelease {
  readonly #release: () => void;
  /** Undefined for a model that keeps its session. */
  readonly #restMs: number | undefined;
  #timer: ReturnType<typeof setTimeout> | undefined;

  constructor(model: GeneratorModel, release: () => void) {
    this.#release = release;
    const cadence = cadenceOf(model);
    const weights = model.externalData.reduce((sum, { data }) => sum + data.length, model.bytes.length);
    if (cadence === 'once' || (cadence === 'chosen' && weights >= LARGE_BYTES)) this.#restMs = REST_MS;
  }

  runBegins(): void {
    clearTimeout(this.#timer);
  }

  runEnded(): void {
    this.runBegins();
    if (this.#restMs !== undefined) this.#timer = setTimeout(this.#release, this.#restMs);
  }
}
