/** Shows the arrays of the property `splats` with WebGL 2. The module is loaded only for them. */
import type { PackedSplats } from '../loading/pack-splats.js';
import type { SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import { nothingToDraw } from '../sources/splats/rows.js';
import { SplatInput, type SplatSink, type SplatState } from '../sources/splats/splat-input.js';
import type { DynamicListeners, Timeline } from '../sources/generator/dynamic-model.js';
import type { OpenOptions } from '../sources/source-kind.js';
import type { SceneBounds } from '../viewer/camera/settings.js';
import { GlLoaded, type GlUploadOptions } from './gl-loaded.js';
import type { GlLease } from './gl-session.js';

/** Opens the splats of an element. Rejects as `open` of open-splats.ts does. */
export async function openGlSplats(
  lease: GlLease,
  { limits }: SceneRequest,
  options: OpenOptions,
  upload: GlUploadOptions,
): Promise<GlLoaded> {
  const { loader, live, beforeUpload, signal } = options;
  const { element, listeners } = live();
  const input = SplatInput.of(element);
  const state = await input.first(signal, limits);
  const first = await pack(loader, state, signal);
  const player = new GlSplatsPlayer(input, first, { lease, loader, listeners, upload });
  beforeUpload(first.packed.geometry.byteLength);
  player.scene = await GlLoaded.open(lease, first, upload, player);
  input.attach(player, state);
  return player.scene;
}

/** Packs a state in the worker. */
async function pack(loader: SceneLoader, state: SplatState, signal: AbortSignal): Promise<PackedSplats> {
  const scene = await loader.ask('splats', state, signal);
  signal.throwIfAborted();
  if (scene.packed.count === 0 && state.count > 0) throw nothingToDraw(state.count);
  return scene;
}

interface PlayerOptions {
  readonly lease: GlLease;
  readonly loader: SceneLoader;
  readonly listeners: DynamicListeners;
  readonly upload: GlUploadOptions;
}

/** Replaces the textures of a scene by those of other states. */
class GlSplatsPlayer implements Timeline, SplatSink {
  readonly duration = NaN;
  isReady = false;
  bounds: SceneBounds;
  #rows: Uint32Array;
  /** Scene that shows the splats. Its creator sets this property once. */
  scene: GlLoaded | undefined;
  readonly #input: SplatInput;
  readonly #options: PlayerOptions;
  readonly #life = new AbortController();

  constructor(input: SplatInput, { bounds, rows }: PackedSplats, options: PlayerOptions) {
    this.#input = input;
    this.bounds = bounds;
    this.#rows = rows;
    this.#options = options;
  }

  /** Called in each frame. */
  request(): void {
    this.isReady = true;
    this.#input.proceed();
  }

  rowOf(index: number): number {
    return this.#rows[index];
  }

  async show(state: SplatState): Promise<void> {
    const { lease, loader, listeners, upload } = this.#options;
    const { signal } = this.#life;
    this.isReady = false;
    try {
      const scene = await pack(loader, state, signal);
      const content = await GlLoaded.contentOf(lease, scene, { ...upload, signal });
      this.scene!.replace(content);
      this.bounds = scene.bounds;
      this.#rows = scene.rows;
      listeners.onInput();
    } catch (error) {
      // A scene that was removed meanwhile shows no state.
      if (signal.aborted) return;
      this.isReady = true;
      throw error;
    }
  }

  fail(error: unknown): void {
    this.#options.listeners.onError(error);
  }

  close(): void {
    this.#life.abort();
    this.#input.detach(this);
  }
}
