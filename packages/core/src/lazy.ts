import { loadModule } from './load-module.js';

/** Minimum time between a failure and the next request of {@link Lazy.want}, ms. */
const PAUSE_MS = 5_000;

/** Code that few pages need, loaded at its first use. A failure is not cached: the next use loads it again. */
export class Lazy<T> {
  /** Present once the code is loaded. */
  value: T | undefined;
  #loading: Promise<T> | undefined;
  #failedAt = -Infinity;
  readonly #load: () => Promise<T>;

  /**
   * @param what Purpose of the code, as in "the code that reads PLY".
   * @param load Imports it, and may create a value from it.
   * @param onValue Called once the value is present.
   */
  constructor(what: string, load: () => Promise<T>, onValue: () => void = ignore) {
    this.#load = async () => {
      this.value = await loadModule(what, load);
      onValue();
      return this.value;
    };
  }

  /** @throws GaussianSplatError `network/unreachable` if it cannot be loaded. */
  get(): Promise<T> {
    return (this.#loading ??= this.#load().catch((error: unknown) => {
      this.#loading = undefined;
      this.#failedAt = performance.now();
      throw error;
    }));
  }

  /**
   * Returns the value if it is loaded; otherwise starts loading it. For frequent callers, such as each frame: after a
   * failure requests pause for seconds.
   */
  want(onError: (error: Error) => void = ignore): T | undefined {
    if (this.value === undefined && !this.#loading && performance.now() - this.#failedAt >= PAUSE_MS)
      this.get().catch(onError);
    return this.value;
  }

  /** Resolves, and never rejects, once nothing is being loaded. */
  get settled(): Promise<unknown> {
    return this.#loading?.catch(ignore) ?? Promise.resolve();
  }
}

const ignore = (): void => undefined;
