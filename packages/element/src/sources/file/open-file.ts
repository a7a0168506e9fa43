import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import { pickInitialVariants, prepareInitialVariants } from '@gaussian-splat/renderer';
import { sceneBytes } from '@gaussian-splat/renderer/tools';
import { images, unlessWrong } from '../../gpu/initial-frames.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import type { LoadedScene, PartListener, PartTaker } from '../../loading/protocol.js';
import type { BegunLoad, OpenSource } from '../source-kind.js';
import type { PartUploads } from './part-uploads.js';
import type { PreviewUploads } from './preview-uploads.js';
import { shown, upload } from './upload.js';

/** Requests the device and the file concurrently, then uploads the scene. */
export const open: OpenSource = async (request, options, acquiring) => {
  // If the device or the file fails, the other is canceled, except for WebGL: bytes are useless without a GPU.
  const abort = new AbortController();
  const giveUp = (): void => abort.abort(options.signal.reason);
  options.signal.addEventListener('abort', giveUp, { once: true });
  // Variants for the first frame are selected while the bytes are in transit, and the splats are uploaded.
  prepareInitialVariants();
  const choosing = acquiring.then(({ device }) => pickInitialVariants(device, images()));
  choosing.catch(ignore);
  const { onPreview } = options;
  let previews: Promise<PreviewUploads> | undefined;
  const showPreview =
    onPreview &&
    ((preview: LoadedScene): void => {
      previews ??= import('./preview-uploads.js').then(
        ({ PreviewUploads }) => new PreviewUploads({ ...options, onPreview, ready: choosing }),
      );
      previews.then((uploads) => uploads.show(preview), ignore);
    });
  const endPreviews = (): void => void previews?.then((uploads) => uploads.end(), ignore);
  const device = acquiring.then(({ device }) => {
    options.signal.throwIfAborted();
    limitScenes(device, options.memoryBudget);
    return device;
  });
  const beforeUpload = (byteLength: number): void => {
    endPreviews();
    options.beforeUpload(byteLength);
  };
  let parts: Promise<PartUploads> | undefined;
  const onPart: PartListener = (part) => {
    parts ??= loadModule('the code that uploads large scenes', () => import('./part-uploads.js')).then(
      ({ PartUploads }) => new PartUploads(device, { ...options, beforeUpload }),
    );
    return parts.then((uploads) => uploads.add(part));
  };
  const listeners: BegunLoad['listeners'] = { onPreview: showPreview, onPart };
  const loading = options.loader.ask('load', request, abort.signal, {
    onProgress: options.onProgress,
    onPreview: showPreview && ((preview) => listeners.onPreview?.(preview)),
    onPart: (part) => listeners.onPart?.(part),
  });
  try {
    const chosen = choosing.catch(unlessWrong);
    chosen.catch(ignore);
    const [lease, scene] = await Promise.all([acquiring, loading, device]);
    if ('frames' in scene) {
      await chosen;
      return scene;
    }
    if (scene.packed === undefined) {
      const gaussians = await (await parts!).finish();
      await chosen;
      options.signal.throwIfAborted();
      return shown(lease, gaussians, scene, options);
    }
    beforeUpload(sceneBytes(scene.packed));
    return await upload(lease, scene, options, chosen);
  } catch (error) {
    endPreviews();
    parts?.then((uploads) => uploads.destroy(), ignore);
    loading.catch(ignore);
    const isWithoutGpu = request.renderer === 'auto' && (error as Partial<GaussianSplatError>).family === 'unsupported';
    if (isWithoutGpu && !parts && !request.levels) {
      let take!: (add: PartTaker) => void;
      const taker = new Promise<PartTaker>((resolve) => (take = resolve));
      const giveLater: PartListener = (part) => taker.then((add) => add(part));
      Object.assign(listeners, { onPreview: undefined, onPart: giveLater });
      options.begun.load = { loading, listeners, abort, take };
    } else abort.abort(error);
    throw error;
  } finally {
    if (!options.begun.load) options.signal.removeEventListener('abort', giveUp);
  }
};

function ignore(): void {
  // Another promise reports the failure.
}
