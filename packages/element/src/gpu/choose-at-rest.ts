import { autotune } from '@gaussian-splat/renderer';
import { sinceLastImage } from './frame-scheduler.js';

/** Time without a frame after which the page counts as idle, ms. */
const REST_MS = 1500;

/**
 * Autotunes a device for later visits, in steps while nothing moves. The current scene keeps its variants. Has no
 * effect if a result is already stored.
 */
export function chooseAtRest(device: GPUDevice): void {
  // No code waits for the result, and current frames are correct without it.
  autotune(device, { pause: untilRest }).catch(() => undefined);
}

async function untilRest(): Promise<void> {
  let left: number;
  while ((left = document.hidden ? REST_MS : REST_MS - sinceLastImage()) > 0)
    await new Promise((resolve) => setTimeout(resolve, left));
  // Safari does not support requestIdleCallback.
  if ('requestIdleCallback' in globalThis) await new Promise((resolve) => requestIdleCallback(resolve));
}
