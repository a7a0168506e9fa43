/** Programs that all renderers of a context share. A page compiles them once, for any number of scenes. */
import { layouts } from '../generated/shaders.js';
import { drawn } from './gl-clock.js';
import { GlProgram } from './gl.js';
import {
  composeFragment,
  composeVertex,
  fullScreenVertex,
  probeCrossFragment,
  probeFragment,
  probeSurfaceFragment,
  ProbeView,
  projectFragment,
  quadsFragment,
  quadsVertex,
  QuadsView,
} from './shaders.js';

const SPLAT_TEXTURES = ['shapes', 'paints', 'order'];
const PROBE_TEXTURES = [...SPLAT_TEXTURES, 'asked', 'ranges'];
const CROSS_TEXTURES = ['runs', 'ranges'];
const SURFACE_TEXTURES = ['geometry', 'order', 'asked', 'ranges'];
/** Milliseconds between two queries of the status of a compilation. */
const POLL_MS = 4;

const known = new WeakMap<WebGL2RenderingContext, GlPrograms>();

/** Programs that find splats at points: see the shaders of the same names in `shaders/webgl`. */
export interface ProbePrograms {
  readonly runs: GlProgram<typeof ProbeView>;
  readonly cross: GlProgram<typeof ProbeView>;
  readonly surface: GlProgram<typeof layouts.View>;
}

export class GlPrograms {
  readonly project: GlProgram<typeof layouts.View>;
  readonly quads: GlProgram<typeof QuadsView>;
  readonly compose: GlProgram<typeof layouts.Compose>;
  readonly #gl: WebGL2RenderingContext;
  #probe: ProbePrograms | undefined;

  private constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    this.project = new GlProgram(gl, [fullScreenVertex, projectFragment], layouts.View, ['geometry', 'harmonics']);
    this.quads = new GlProgram(gl, [quadsVertex, quadsFragment], QuadsView, SPLAT_TEXTURES);
    this.compose = new GlProgram(gl, [composeVertex, composeFragment], layouts.Compose, ['accumulated']);
  }

  /** Returns the programs of a context. The first call starts their compilation. */
  static of(gl: WebGL2RenderingContext): GlPrograms {
    const old = known.get(gl);
    if (old) return old;
    const programs = new GlPrograms(gl);
    if (gl.isContextLost()) return programs;
    known.set(gl, programs);
    // A restored context has lost its programs.
    gl.canvas.addEventListener('webglcontextlost', () => known.delete(gl), { once: true });
    return programs;
  }

  /** Programs that find splats at points of a frame. @throws GaussianSplatError `unsupported/webgl` */
  get probe(): ProbePrograms {
    const gl = this.#gl;
    this.#probe ??= {
      runs: new GlProgram(gl, [fullScreenVertex, probeFragment], ProbeView, PROBE_TEXTURES),
      cross: new GlProgram(gl, [fullScreenVertex, probeCrossFragment], ProbeView, CROSS_TEXTURES),
      surface: new GlProgram(gl, [fullScreenVertex, probeSurfaceFragment], layouts.View, SURFACE_TEXTURES),
    };
    for (const program of Object.values(this.#probe) as ProbePrograms[keyof ProbePrograms][]) program.check();
    return this.#probe;
  }

  /** Resolves when {@link check} would return at once. Other tasks run meanwhile. */
  async compiled(): Promise<void> {
    while (!this.#needed.every(({ isCompiled }) => isCompiled))
      await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    // Waits for earlier draw calls, because a WebGL query would block until they are done.
    await drawn(this.#gl).catch(() => undefined);
  }

  /**
   * Prepares the programs to draw. Blocks the thread until they are compiled.
   * @throws GaussianSplatError `unsupported/webgl` if the browser does not compile the shaders.
   */
  check(): this {
    for (const program of this.#needed) program.check();
    return this;
  }

  get #needed(): readonly Pick<GlProgram<typeof QuadsView>, 'check' | 'isCompiled'>[] {
    return [this.project, this.quads, this.compose];
  }
}
