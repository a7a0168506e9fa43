import type { WorkTime } from '../gpu/queue-clock.js';

/** When the page was told that work was done, and when it was last told that it was not, by the page's clock. */
interface Told {
  readonly now: number;
  readonly since: number;
}

/** Fulfils when all that was drawn until now is done. Rejects where the context is lost. */
export async function drawn(gl: WebGL2RenderingContext): Promise<Told> {
  const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  let since = performance.now();
  try {
    // Its state changes between tasks only.
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

/** Times frames as a page waits for them: see `QueueClock`, of which this is WebGL's. */
export class GlClock {
  readonly #gl: WebGL2RenderingContext;
  #last: Told = { now: -Infinity, since: -Infinity };

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  /**
   * Times what `draw` draws. Rejects where the context is lost.
   * @param least what it surely takes, ms: where a browser waits for frames on the page's thread, little else is known
   */
  async time(draw: () => void, least = 0): Promise<WorkTime> {
    const begin = performance.now();
    draw();
    // Where the browser draws at once, nothing else could be done meanwhile.
    const busy = performance.now() - begin;
    const told = await drawn(this.#gl);
    // Of the frame before, which may have been drawn, but not done, when this one was.
    const before = this.#last;
    this.#last = told;
    const atMost = told.now - Math.max(begin, before.since);
    const atLeast = Math.min(atMost, Math.max(least, busy, told.since - Math.max(begin, before.now)));
    return { doneAt: told.now, atLeast, atMost };
  }
}
