/** Waits that end, and know what they waited for: a page that measures always has something to report. */

/** Rejects, with the name of the missing result, after a number of seconds. */
export function within(seconds, what, promise) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`waited ${seconds} s for ${what}`)), 1000 * seconds);
  });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

/** The current step of a page, for error messages, and the time by which it must end. */
export class Progress {
  #what = 'the start';
  #since = performance.now();
  #end;
  #say;

  /**
   * @param seconds until everything must have ended
   * @param say gets a sentence whenever something else begins
   */
  constructor(seconds, say) {
    this.#end = performance.now() + 1000 * seconds;
    this.#say = say;
  }

  begin(what) {
    this.#what = what;
    this.#since = performance.now();
    this.#say(`${what} …`);
  }

  /** Seconds left. */
  get left() {
    return Math.max(0, (this.#end - performance.now()) / 1000);
  }

  /** Name of the last step, and milliseconds since its start. */
  toString() {
    return `${this.#what}, for ${((performance.now() - this.#since) / 1000).toFixed(1)} s`;
  }

  /** Waits for a promise, up to a number of seconds or the time limit of the page. */
  wait(what, promise, seconds = Infinity) {
    this.begin(what);
    return within(Math.min(seconds, Math.max(0.001, this.left)), what, promise);
  }
}
