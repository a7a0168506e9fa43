/** Handling of lost devices in a scene's life cycle. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { Backend } from './backend.js';

/** The device was lost before the first frame. */
export class DeviceLostError extends Error {
  /** Loss information of the browser. */
  readonly info: GPUDeviceLostInfo;

  constructor(info: GPUDeviceLostInfo) {
    super(info.message);
    this.info = info;
  }
}

/** A missing device is final at first, but after a loss it may only be delayed. */
export function isDeviceFailure(error: unknown, isNew: boolean): boolean {
  if (error instanceof DeviceLostError) return true;
  if (!(error instanceof GaussianSplatError)) return false;
  // A generator may be the first to detect the loss.
  return error.family === 'device-lost' || (!isNew && error.family === 'unsupported');
}

/** Maximum delay of the report of a loss, ms: buffers of the device fail before. */
const LOSS_MS = 200;

/** Whether a failure resulted from the end of drawing, or from a lost device. */
export async function isGone(backend: Pick<Backend, 'isDestroyed' | 'isLost'>): Promise<boolean> {
  if (!backend.isDestroyed && !backend.isLost) await delay(LOSS_MS);
  return backend.isDestroyed || backend.isLost;
}

/** Whether the device was lost before all submitted work was done. */
export async function wasLost(backend: Pick<Backend, 'finished' | 'isLost'>): Promise<boolean> {
  await backend.finished();
  // The loss is reported a little later.
  await new Promise((resolve) => setTimeout(resolve));
  return backend.isLost;
}

export const delay = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

/** Resolves when the page is visible, or the wait is aborted: a hidden page would only lose its device again. */
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
