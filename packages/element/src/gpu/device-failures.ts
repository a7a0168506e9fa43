/** Detects failures that lost devices cause, and waits for the page to be visible. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { Backend } from './backend.js';

/** Error of a scene whose device was lost before its first frame. */
export class DeviceLostError extends Error {
  /** Loss information of the browser. */
  readonly info: GPUDeviceLostInfo;

  constructor(info: GPUDeviceLostInfo) {
    super(info.message);
    this.info = info;
  }
}

/**
 * Returns whether an error results from a lost device, so that another attempt may succeed. For a new scene (`isNew`) a
 * missing device is final; after a loss it may only be delayed.
 */
export function isDeviceFailure(error: unknown, isNew: boolean): boolean {
  if (error instanceof DeviceLostError) return true;
  if (!(error instanceof GaussianSplatError)) return false;
  // A generator may detect the loss before the device reports it.
  return error.family === 'device-lost' || (!isNew && error.family === 'unsupported');
}

/** Maximum delay between the first failures of a lost device's buffers and the report of the loss, ms. */
const LOSS_MS = 200;

/**
 * Returns whether a failure has resulted from the end of drawing, or from a lost device. Waits up to {@link LOSS_MS}
 * for the report of a loss.
 */
export async function isGone(backend: Pick<Backend, 'isDestroyed' | 'place'>): Promise<boolean> {
  if (!backend.isDestroyed && !backend.place.isLost) await delay(LOSS_MS);
  return backend.isDestroyed || backend.place.isLost;
}

export const delay = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

/**
 * Resolves when the page is visible, or the wait is aborted. A device that is requested by a hidden page would only be
 * lost again.
 */
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
