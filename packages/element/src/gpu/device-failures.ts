/** What a scene's life knows of devices that are lost. */
import { GaussianSplatError } from '@gaussian-splat/core';

/** The device went away before the scene was seen. */
export class DeviceLostError extends Error {}

/** A device that does not come at all is final at first, but after a loss it may only need a moment. */
export function isDeviceFailure(error: unknown, isNew: boolean): boolean {
  if (error instanceof DeviceLostError) return true;
  if (!(error instanceof GaussianSplatError)) return false;
  // A generator may be the first to notice.
  return error.family === 'device-lost' || (!isNew && error.family === 'unsupported');
}

export function unrecoverable(cause: unknown): GaussianSplatError {
  return new GaussianSplatError('device-lost/unrecoverable', {
    where: 'GPU device',
    expected: 'a device that stays long enough to draw the scene',
    found: cause instanceof Error ? cause.message || 'a device that was lost' : String(cause),
    remedy: 'reload the page; if it happens again, use a smaller scene or update the graphics driver',
    cause,
  });
}

export const delay = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

/** Fulfils when the page can be seen, or the wait is aborted: a hidden page would only lose its device again. */
export function pageVisible(signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const check = (): void => {
      if (document.visibilityState === 'hidden' && !signal.aborted) return;
      document.removeEventListener('visibilitychange', check);
      signal.removeEventListener('abort', check);
      resolve();
    };
    document.addEventListener('visibilitychange', check);
    signal.addEventListener('abort', check);
    check();
  });
}
