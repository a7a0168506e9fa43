/** Loaded only where no other device comes in place of one that was lost. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { timerMs } from '../attributes.js';
import { delay, isDeviceFailure } from './device-failures.js';
import type { DeviceLease, SharedDevice } from './shared-device.js';

/** @param loss what the browser said of the device that was lost, where it has. */
export function unrecoverable(cause: unknown, loss?: GPUDeviceLostInfo): GaussianSplatError {
  const said = loss && ` (reason "${loss.reason}": ${loss.message.replace(/\.$/, '') || 'nothing more is known'})`;
  const lost = `a device that was lost${said ?? ''}`;
  const why = cause instanceof GaussianSplatError ? `${cause.where}: ${cause.found}` : String(cause);
  const isLoss = isDeviceFailure(cause, true);
  // Chromium refuses a page that has lost two devices within a short time any other, until it is loaded again.
  const reload = isLoss ? 'reload the page' : 'reload the page, to which the browser may refuse the GPU until then';
  return new GaussianSplatError('device-lost/unrecoverable', {
    where: 'GPU device',
    expected: 'a device that stays long enough to draw the scene',
    found: isLoss ? lost : `${lost}, and no other in its place (${why})`,
    remedy:
      loss?.reason === 'destroyed'
        ? "a script of this page called the device's destroy(): leave that, or let SharedDevice's function request a new device each time"
        : `${reload}; if it happens again, use a smaller scene or update the graphics driver`,
    cause,
  });
}

/** Pause before the first question, ms; it doubles each time. */
const FIRST_MS = 5_000;
const LONGEST_MS = 300_000;
/** A page that comes into sight asks at once, but no sooner than this after the last question, ms. */
const LEAST_MS = 2_000;

/**
 * Asks for a device ever more rarely, and whenever the page comes into sight: browsers that refuse a page the GPU after crashes do so for some minutes.
 * @returns a share in it; undefined once the wait is aborted
 */
export async function deviceBack(device: SharedDevice, signal: AbortSignal): Promise<DeviceLease | undefined> {
  for (let pause = FIRST_MS; ; pause = Math.min(LONGEST_MS, 2 * pause)) {
    await delay(LEAST_MS);
    await untilShown(pause - LEAST_MS, signal);
    if (signal.aborted) return undefined;
    const lease = await device.acquire().catch(() => undefined);
    if (lease && !signal.aborted) return lease;
    lease?.release();
  }
}

/** Fulfils after a while, when the page comes into sight, or when the wait is aborted. */
function untilShown(milliseconds: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const end = (): void => {
      clearTimeout(timer);
      document.removeEventListener('visibilitychange', check);
      signal.removeEventListener('abort', end);
      resolve();
    };
    const check = (): void => {
      if (document.visibilityState === 'visible') end();
    };
    const timer = setTimeout(end, timerMs(milliseconds));
    document.addEventListener('visibilitychange', check);
    signal.addEventListener('abort', end);
    if (signal.aborted) end();
  });
}
