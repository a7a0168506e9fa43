import { autotune } from '@gaussian-splat/renderer';
import { sinceLastPicture } from './frame-scheduler.js';

/** Milliseconds without a picture after which a page counts as at rest. */
const REST_MS = 1500;

/**
 * Finds what suits a device best, for pages to come: a piece whenever nothing has moved for a while. What is on show keeps what it was begun with. Does nothing
 * where that is known already.
 */
export function chooseAtRest(device: GPUDevice): void {
  // Nobody waits for it, and what is on show is right without.
  autotune(device, { pause: untilRest }).catch(() => undefined);
}

async function untilRest(): Promise<void> {
  let left: number;
  while ((left = document.hidden ? REST_MS : REST_MS - sinceLastPicture()) > 0)
    await new Promise((resolve) => setTimeout(resolve, left));
  // Safari has no such thing.
  if ('requestIdleCallback' in globalThis) await new Promise((resolve) => requestIdleCallback(resolve));
}
