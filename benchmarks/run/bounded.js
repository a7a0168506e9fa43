/** Waits that end, and know what they waited for: a page that measures always has something to report. */

/** Rejects, with the name of what did not come, after so many seconds. */
export function within(seconds, what, promise) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`waited ${seconds} s for ${what}`)), 1000 * seconds);
  });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

/** What a page does at the moment, for whoever has to say it, and when it must have ended. */
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

  /** What began last, and how long ago. */
  toString() {
    return `${this.#what}, for ${((performance.now() - this.#since) / 1000).toFixed(1)} s`;
  }

  /** Waits for a promise, at most so many seconds or until everything must have ended. */
  wait(what, promise, seconds = Infinity) {
    this.begin(what);
    return within(Math.min(seconds, Math.max(0.001, this.left)), what, promise);
  }
}
