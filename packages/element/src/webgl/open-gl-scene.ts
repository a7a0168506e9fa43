/** Opens scenes with WebGL 2. Loaded for pages without WebGPU, or with `renderer="webgl"`. */
import { loadModule } from '@gaussian-splat/core';
import { faultsOf } from '@gaussian-splat/renderer/tools';
import { glBytes } from '@gaussian-splat/renderer/webgl';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { Content } from '../sources/content.js';
import type { OpenOptions } from '../sources/source-kind.js';
import { kindOf } from '../sources/source-kinds.js';
import { streamCaps } from '../sources/stream/stream-caps.js';
import type { LoadedScene, LoadedSequence, SceneRequest, SentScene } from '../loading/protocol.js';
import { GlLoaded } from './gl-loaded.js';
import { JoinedParts } from './joined-parts.js';
import { acquireGl, cannotShow, noWebGl, type GlLease } from './gl-session.js';
import { WebGlBackend } from './webgl-backend.js';

/** Selector of children that add sources to the element's own scene. */
const CHILDREN = 'splat-scene, splat-mesh';

/** Contents that WebGL does not draw, as messages call them. */
const NAMES: Partial<Record<Content, string>> = {
  children: 'a <splat-scene> or <splat-mesh>',
  mesh: 'a mesh',
  generator: 'a generator',
  clip: 'a clip',
  sequence: 'a sequence of scenes',
  'post-processor': 'a post-processor',
};

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
  const { memoryBudget = Infinity } = options;
  const isStream = kindOf(asked).name === 'stream';
  const streamBytes = isStream ? Math.min(memoryBudget, streamCaps().bytes) : undefined;
  const request = { ...asked, levels: asked.levels && WebGlBackend.can('levels'), streamBytes };
  const lease = acquireGl();
  const { load } = options.begun;
  if (lease === undefined) {
    load?.abort.abort(reason);
    throw reason ?? noWebGl();
  }
  if (reason instanceof Error) faultsOf(lease.gl)[0] = `WebGL 2 draws: ${reason.message}`;
  const { signal, onProgress, beforeUpload, loader, live } = options;
  const requireDrawable = (found?: LoadedSequence): void => {
    const refused = contentsOf(kindOf(request, found).name, live()).find((content) => !WebGlBackend.can(content));
    if (refused) throw cannotShow(NAMES[refused] ?? refused, reason);
  };
  try {
    requireDrawable();
    if (request.splats) {
      const { openGlSplats } = await loadModule('the code that shows arrays', () => import('./gl-splats.js'));
      return await openGlSplats(lease, request, options, openOptions(options, signal));
    }
    const previews = new Previews(options);
    const parts = new JoinedParts();
    const onPreview = options.onPreview && previews.show;
    load?.take(parts.add);
    if (load) Object.assign(load.listeners, { onPreview });
    const loading = load?.loading ?? loader.ask('load', request, signal, { onProgress, onPreview });
    const scene = await loading.finally(() => previews.end());
    signal.throwIfAborted();
    // Children may have been added meanwhile.
    requireDrawable('frames' in scene ? scene : undefined);
    const answer = scene as LoadedScene | SentScene;
    const whole: LoadedScene = { ...answer, packed: answer.packed ?? parts.packed! };
    beforeUpload(glBytes(whole.packed));
    return await GlLoaded.open(lease, whole, openOptions(options, signal));
  } catch (error) {
    load?.abort.abort(error);
    lease.release();
    throw error;
  }
}

/** Returns what an element shows, with a source of a kind. */
function contentsOf(kind: Content, { element, ownsControls }: ReturnType<OpenOptions['live']>): readonly Content[] {
  const hasOthers = element.matches(CHILDREN) || element.querySelector(`:scope > :is(${CHILDREN})`) !== null;
  return [...(hasOthers ? ['children' as const] : []), kind, ...(ownsControls() ? [] : ['post-processor' as const])];
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
