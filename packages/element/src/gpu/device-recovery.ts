/** Handles lost devices that cannot be replaced at once. The module is loaded only then. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { timerMs } from '../viewer/attribute.js';
import { delay, isDeviceFailure } from './device-failures.js';
import type { DeviceLease, SharedDevice } from './shared-device.js';

/**
 * Returns the error of a scene whose device was lost for good, `device-lost/unrecoverable`.
 * @param cause Error of the last attempt.
 * @param loss Loss information of the browser, if there is any.
 */
export function unrecoverable(cause: unknown, loss?: GPUDeviceLostInfo): GaussianSplatError {
  const said = loss && ` (reason "${loss.reason}": ${loss.message.replace(/\.$/, '') || 'nothing more is known'})`;
  const lost = `a device that was lost${said ?? ''}`;
  const why = cause instanceof GaussianSplatError ? `${cause.where}: ${cause.found}` : String(cause);
  const isLoss = isDeviceFailure(cause, true);
  // If a page loses two devices within a short time, Chromium grants it no other device until it is reloaded.
  const reload = isLoss ? 'reload the page' : 'reload the page, to which the browser may refuse the GPU until then';
  return new GaussianSplatError('device-lost/unrecoverable', {
    where: 'GPU device',
    expected: 'a device that stays long enough to draw the scene',
    found: isLoss ? lost : `${lost}, and no other in its place (${why})`,
    remedy:
      loss?.reason === 'destroyed'
        ? "a script of this page called the device's destroy(): remove that call, or let SharedDevice's function request a new device each time"
        : `${reload}; if it happens again, use a smaller scene or update the graphics driver`,
    cause,
  });
}

/** Delay of the first request, ms. It doubles for each further request, up to the second constant. */
const FIRST_MS = 5_000;
const LONGEST_MS = 300_000;
/** Minimum delay between two requests, ms, also when the page becomes visible. */
const MIN_MS = 2_000;

/**
 * Requests a device at increasing intervals, and whenever the page becomes visible. Browsers that deny a page the GPU
 * after crashes do so for some minutes.
 * @returns A lease of the device; undefined if the wait is aborted.
 */
export async function waitForDevice(device: SharedDevice, signal: AbortSignal): Promise<DeviceLease | undefined> {
  for (let pause = FIRST_MS; ; pause = Math.min(LONGEST_MS, 2 * pause)) {
    await delay(MIN_MS);
    await untilShown(pause - MIN_MS, signal);
    if (signal.aborted) return undefined;
    const lease = await device.acquire().catch(() => undefined);
    if (lease && !signal.aborted) return lease;
    lease?.release();
  }
}

/** Resolves after a time in milliseconds, or earlier if the page becomes visible or the wait is aborted. */
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
