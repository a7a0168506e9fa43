import type { GaussianModelFile } from '@gaussian-splat/generator';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../camera/settings.js';
import { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { OpenOptions } from '../gpu/open-scene.js';
import type { DynamicRequest, Timeline } from './dynamic-model.js';
import type { InputImages } from './input-images.js';

/** Destination of a scene without splats meanwhile. */
export type WaitingPlace = Pick<OpenOptions, 'device' | 'onPreview' | 'submissions'>;

/** Polling interval for the inputs of an element that draws nothing, ms. */
const LOOK_MS = 250;

/** Bounds of an unknown subject. */
const UNIT_BALL: SceneBounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 };

/**
 * Resolves once all image inputs of a generator have arrived. Meanwhile the element shows a scene without splats, so
 * that the page and the panel of controls know the inputs.
 * @throws the reason of the signal.
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
    // Checked in every frame; an off-screen element draws none.
    const timer = place.onPreview ? undefined : setInterval(look, LOOK_MS);
    const waiting: Timeline = { duration: NaN, inputs, settable, request: look, close: () => undefined };
    void showEmpty(place, layout, waiting).then(look, reject);
  });
}

async function showEmpty(
  { device, onPreview, submissions }: WaitingPlace,
  layout: GaussianModelFile['layout'],
  live: Timeline,
): Promise<void> {
  if (onPreview === undefined) return;
  const lease = await device.acquire();
  try {
    const gaussians = await DynamicGaussians.create(lease.device, { ...layout, capacity: 1, paddedRows: undefined });
    onPreview(new LoadedGaussians(lease, gaussians, UNIT_BALL, submissions, { live }));
  } catch (error) {
    lease.release();
    throw error;
  }
}
