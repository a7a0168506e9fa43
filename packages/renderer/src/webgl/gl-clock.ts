import type { WorkTime } from '../gpu/queue-clock.js';

/**
 * Time of the notification that work was done, and of the last check before it, both in milliseconds as
 * `performance.now()` returns.
 */
interface ObservedTime {
  readonly now: number;
  readonly since: number;
}

/** Resolves when the GPU has executed all commands issued before the call. Rejects if the context is lost. */
export async function drawn(gl: WebGL2RenderingContext): Promise<ObservedTime> {
  const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  let since = performance.now();
  try {
    // The state of the sync object changes only between tasks.
    for (;;) {
      await new Promise((resolve) => setTimeout(resolve));
      if (sync === null || gl.isContextLost()) throw new Error('the WebGL context is lost');
      const now = performance.now();
      if (gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.SIGNALED) return { now, since };
      since = now;
    }
  } finally {
    gl.deleteSync(sync);
  }
}

/** Measures the duration of frames as a page experiences them: the WebGL counterpart of `QueueClock`. */
export class GlClock {
  readonly #gl: WebGL2RenderingContext;
  #last: ObservedTime = { now: -Infinity, since: -Infinity };

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  /**
   * Measures the duration of the commands that `draw` issues. Rejects if the context is lost.
   * @throws the errors of `draw`, before the method returns
   * @param min Lower bound of the result in milliseconds. Some browsers wait for frames on the main thread, so that
   * little else is known.
   */
  time(draw: () => void, min = 0): Promise<WorkTime> {
    const begin = performance.now();
    draw();
    return this.#timeSince(begin, min);
  }

  async #timeSince(begin: number, min: number): Promise<WorkTime> {
    // If the browser draws synchronously, the thread was busy for the whole time.
    const busy = performance.now() - begin;
    const observed = await drawn(this.#gl);
    // The previous frame may have completed only after this frame was drawn.
    const before = this.#last;
    this.#last = observed;
    const upperBound = observed.now - Math.max(begin, before.since);
    const lowerBound = Math.min(upperBound, Math.max(min, busy, observed.since - Math.max(begin, before.now)));
    return { doneAt: observed.now, lowerBound, upperBound };
  }
}
