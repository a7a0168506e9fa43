import type { GeneratorModel } from './open-model.js';

/**
 * Run frequency of a model. `once`: it has no inputs. `chosen`: its inputs are images and settings of a visitor.
 * `continuous`: a clock, a camera, a pose or another model may change an input in each frame.
 */
export type Cadence = 'once' | 'chosen' | 'continuous';

/** Roles of inputs that change only when a visitor selects another value. */
const CHOSEN: ReadonlySet<string> = new Set(['image', 'control', 'shape', 'seed']);

/**
 * Returns the run frequency of a model from the roles of its inputs. A post-processor is continuous, because its image
 * is the frame.
 */
export function cadenceOf({ contract, layout }: Pick<GeneratorModel, 'contract' | 'layout'>): Cadence {
  const roles = Object.values(contract.inputs).map(({ role }) => role);
  if (layout === undefined) return 'continuous';
  if (roles.length === 0) return 'once';
  return roles.includes('image') && roles.every((role) => CHOSEN.has(role)) ? 'chosen' : 'continuous';
}

/**
 * Minimum bytes of weights from which an unused session of a model of cadence `chosen` is released. The memory of a
 * smaller session is not worth another start.
 */
const LARGE_BYTES = 16 * 2 ** 20;
/** Time from the last run until the release, milliseconds. */
const REST_MS = 5_000;

/** Releases the session of an unused model, including its weights, some time after its last run. */
export class WeightRelease {
  readonly #release: () => void;
  /** Milliseconds without a run before the release; undefined for a model that keeps its session. */
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
