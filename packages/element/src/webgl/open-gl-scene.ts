/** Opens scenes with WebGL 2. Loaded for pages without WebGPU, or with `renderer="webgl"`. */
import { faultsOf } from '@gaussian-splat/renderer/tools';
import { glBytes } from '@gaussian-splat/renderer/webgl';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { isGenerator, isStreamed, type OpenOptions } from '../gpu/open-scene.js';
import { streamCaps } from '../sources/stream/stream-caps.js';
import type { LoadedScene, SceneRequest } from '../loading/protocol.js';
import { GlLoaded } from './gl-loaded.js';
import { acquireGl, cannotShow, noWebGl, type GlLease } from './gl-session.js';

/** Selector of children that add sources to the element's own scene. */
const CHILDREN = 'splat-scene, splat-mesh';

/**
 * Opens a scene file with WebGL 2.
 * @param reason Error that WebGPU failed with; undefined if the page requests WebGL.
 * @throws GaussianSplatError `reason` without WebGL 2; `unsupported/webgl` for features that WebGL lacks; errors of
 * loading; or the signal's reason
 */
export async function openGlScene(
  asked: SceneRequest,
  options: OpenOptions,
  reason: unknown,
): Promise<LoadedGaussians> {
  // Levels of detail need WebGPU. WebGL draws the finest level, or as much of a streamed scene as fits into memory.
  const { memoryBudget = Infinity } = options;
  const streamBytes = isStreamed(asked) ? Math.min(memoryBudget, streamCaps().bytes) : undefined;
  const request = { ...asked, levels: false, streamBytes };
  const lease = acquireGl();
  if (lease === undefined) throw reason ?? noWebGl();
  if (reason instanceof Error) faultsOf(lease.gl)[0] = `WebGL 2 draws: ${reason.message}`;
  const { signal, onProgress, beforeUpload, loader, live } = options;
  const requireAlone = (): void => {
    const { element } = live();
    if (element.matches(CHILDREN) || element.querySelector(`:scope > :is(${CHILDREN})`))
      throw cannotShow('a <splat-scene> or <splat-mesh>', reason);
  };
  try {
    requireAlone();
    if (isGenerator(request) || request.chain?.length) throw cannotShow('a generator', reason);
    if (streamBytes !== undefined && !new URL(request.url).pathname.endsWith('.json'))
      throw cannotShow('a clip', reason);
    if (!live().ownsControls()) throw cannotShow('a post-processor', reason);
    const previews = new Previews(options);
    const scene = await loader
      .ask('load', request, signal, { onProgress, onPreview: options.onPreview && previews.show })
      .finally(() => previews.end());
    signal.throwIfAborted();
    requireAlone();
    if ('frames' in scene) throw cannotShow('a sequence of scenes', reason);
    // Without `onPart`, the answer contains the splats.
    const whole = scene as LoadedScene;
    beforeUpload(glBytes(whole.packed));
    return await GlLoaded.open(lease, whole, openOptions(options, signal));
  } catch (error) {
    lease.release();
    throw error;
  }
}

const openOptions = (
  { memoryBudget, loader: { spawn } }: OpenOptions,
  signal: AbortSignal,
): Parameters<typeof GlLoaded.open>[2] => ({ memoryBudget, spawn, signal });

/** Shows the previews of one load, one at a time. Previews that arrive while another one is uploaded are skipped. */
class Previews {
  readonly #options: OpenOptions;
  readonly #over = new AbortController();
  #isBusy = false;

  constructor(options: OpenOptions) {
    this.#options = options;
  }

  readonly show = (preview: LoadedScene): void => {
    if (!this.#isBusy) void this.#show(preview);
  };

  end(): void {
    this.#over.abort();
  }

  async #show(preview: LoadedScene): Promise<void> {
    const lease: GlLease | undefined = acquireGl();
    if (lease === undefined) return;
    this.#isBusy = true;
    const signal = AbortSignal.any([this.#options.signal, this.#over.signal]);
    try {
      this.#options.onPreview?.(await GlLoaded.open(lease, preview, openOptions(this.#options, signal)));
    } catch {
      // A failure to upload a preview also fails the complete scene, which reports it.
      lease.release();
    } finally {
      this.#isBusy = false;
    }
  }
}
