import { loadModule } from './load-module.js';

/** Minimum milliseconds from a failure to the next load that {@link Lazy.want} starts. */
const PAUSE_MS = 5_000;

/**
 * Code that few pages need, which is loaded at its first use. A failure is not cached: the next use loads the code
 * again.
 */
export class Lazy<T> {
  /** Result of `load`; undefined until the code is loaded. */
  value: T | undefined;
  #loading: Promise<T> | undefined;
  #failedAt = -Infinity;
  readonly #load: () => Promise<T>;

  /**
   * @param what Purpose of the code for error messages, as in "the code that reads PLY".
   * @param load Imports the code, and may create a value from it.
   * @param onValue Called when the value is loaded.
   */
  constructor(what: string, load: () => Promise<T>, onValue: () => void = ignore) {
    this.#load = async () => {
      this.value = await loadModule(what, load);
      onValue();
      return this.value;
    };
  }

  /** Resolves to the value, and loads the code if required. Rejects with `network/unreachable` if loading fails. */
  get(): Promise<T> {
    return (this.#loading ??= this.#load().catch((error: unknown) => {
      this.#loading = undefined;
      this.#failedAt = performance.now();
      throw error;
    }));
  }

  /**
   * Returns the value if it is loaded; otherwise starts to load it and returns undefined. For frequent callers, such as
   * each frame: after a failure, no load starts for {@link PAUSE_MS}.
   */
  want(onError: (error: Error) => void = ignore): T | undefined {
    if (this.value === undefined && !this.#loading && performance.now() - this.#failedAt >= PAUSE_MS)
      this.get().catch(onError);
    return this.value;
  }

  /** Resolves when no load is pending; never rejects. */
  get settled(): Promise<unknown> {
    return this.#loading?.catch(ignore) ?? Promise.resolve();
  }
}

const ignore = (): void => undefined;
