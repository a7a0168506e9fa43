import type { GaussianModelFile } from '@gaussian-splat/generator';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { OpenOptions } from '../source-kind.js';
import { withLease } from '../../gpu/shared-device.js';
import type { DynamicRequest, Timeline } from './dynamic-model.js';
import type { InputImages } from './input-images.js';

/** Options for showing a scene without splats while images are missing. */
export type WaitingPlace = Pick<OpenOptions, 'device' | 'onPreview' | 'submissions'>;

/** Interval at which the inputs of an element without previews are checked, ms. */
const LOOK_MS = 250;

/** Bounds of the scene without splats. */
const UNIT_BALL: SceneBounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 };

/**
 * Resolves when all image inputs of a generator have arrived. Until then the element shows a scene without splats, so
 * that the page and the panel of controls know the inputs. Rejects with the signal's reason, or if that scene cannot be
 * created.
 */
export async function waitForImages(
  { inputs, settable }: Pick<Timeline, 'inputs' | 'settable'>,
  { layout }: Pick<GaussianModelFile, 'layout'>,
  images: InputImages,
  { request, signal, place }: { request: DynamicRequest; signal: AbortSignal; place: WaitingPlace },
): Promise<void> {
  await new Promise<void>((resolve, reject) => {
    const look = (): void => {
      images.update(request.state().images);
      if (!images.areComplete) return;
      clearInterval(timer);
      resolve();
    };
    signal.addEventListener('abort', () => {
      clearInterval(timer);
      reject(signal.reason as Error);
    });
    // The empty scene checks in every frame. An element without previews is off-screen and draws no frames, so a timer
    // checks.
    const timer = place.onPreview ? undefined : setInterval(look, LOOK_MS);
    const waiting: Timeline = { duration: NaN, inputs, settable, request: look, close: () => undefined };
    void showEmpty(place, layout, waiting, signal).then(look, reject);
  });
}

async function showEmpty(
  { device, onPreview, submissions }: WaitingPlace,
  layout: GaussianModelFile['layout'],
  live: Timeline,
  signal: AbortSignal,
): Promise<void> {
  if (onPreview === undefined) return;
  await withLease(device, async (acquiring) => {
    const lease = await acquiring;
    const gaussians = await DynamicGaussians.create(lease.device, { ...layout, capacity: 1, paddedRows: undefined });
    // Another source may have been requested meanwhile, whose scene must not be replaced.
    if (signal.aborted) gaussians.destroy();
    signal.throwIfAborted();
    onPreview(new LoadedGaussians(lease, gaussians, UNIT_BALL, submissions, { live }));
  });
}
