import { loadModule } from './load-module.js';

/** After a failure {@link Lazy.want} asks again no sooner, ms. */
const PAUSE_MS = 5_000;

/** Code that few pages need, fetched on its first use. A failure is not remembered: the next use fetches it again. */
export class Lazy<T> {
  /** Present once the code is there. */
  value: T | undefined;
  #loading: Promise<T> | undefined;
  #failedAt = -Infinity;
  readonly #load: () => Promise<T>;

  /**
   * @param what the code is for, as in "the code that reads PLY"
   * @param load imports it, and may make something of it
   * @param onValue called once the value is there
   */
  constructor(what: string, load: () => Promise<T>, onValue: () => void = ignore) {
    this.#load = async () => {
      this.value = await loadModule(what, load);
      onValue();
      return this.value;
    };
  }

  /** @throws GaussianSplatError `network/unreachable` if it cannot be fetched. */
  get(): Promise<T> {
    return (this.#loading ??= this.#load().catch((error: unknown) => {
      this.#loading = undefined;
      this.#failedAt = performance.now();
      throw error;
    }));
  }

  /** The value if it is there; otherwise starts fetching it. For callers that ask often, such as each frame: after a failure requests pause for seconds. */
  want(onError: (error: Error) => void = ignore): T | undefined {
    if (this.value === undefined && !this.#loading && performance.now() - this.#failedAt >= PAUSE_MS)
      this.get().catch(onError);
    return this.value;
  }

  /** Fulfils, and never rejects, once nothing is being fetched. */
  get settled(): Promise<unknown> {
    return this.#loading?.catch(ignore) ?? Promise.resolve();
  }
}

const ignore = (): void => undefined;
