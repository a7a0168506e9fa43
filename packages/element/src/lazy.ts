import { loadModule } from '@gaussian-splat/core';

/** Code that few pages need: fetched when it is first asked for, and once more where it could not be had. */
export class Lazy<T> {
  /** What it has made, once it is there. */
  value: T | undefined;
  #coming: Promise<T> | undefined;
  readonly #load: () => Promise<T>;

  constructor(what: string, load: () => Promise<T>) {
    this.#load = () => loadModule(what, load);
  }

  /** Rejects where it cannot be had. */
  get(): Promise<T> {
    return (this.#coming ??= this.#load().then(
      (value) => (this.value = value),
      (error: unknown) => {
        this.#coming = undefined;
        throw error;
      },
    ));
  }

  /** Fulfils once nothing of it is on its way. */
  get settled(): Promise<unknown> {
    return this.#coming?.catch(() => undefined) ?? Promise.resolve();
  }
}
