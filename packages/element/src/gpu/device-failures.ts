/** What a scene's life knows of devices that are lost. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { DrawnScene } from './open-scene.js';

/** The device went away before the scene was seen. */
export class DeviceLostError extends Error {
  /** What the browser says of it. */
  readonly info: GPUDeviceLostInfo;

  constructor(info: GPUDeviceLostInfo) {
    super(info.message);
    this.info = info;
  }
}

/** A device that does not come at all is final at first, but after a loss it may only need a moment. */
export function isDeviceFailure(error: unknown, isNew: boolean): boolean {
  if (error instanceof DeviceLostError) return true;
  if (!(error instanceof GaussianSplatError)) return false;
  // A generator may be the first to notice.
  return error.family === 'device-lost' || (!isNew && error.family === 'unsupported');
}

/** How long it takes at most until a lost device says so, ms: its buffers fail before. */
const LOSS_MS = 200;

/** Whether what failed did so because its scene was given up, or lost its device. */
export async function isGone(scene: DrawnScene): Promise<boolean> {
  if (!scene.isDestroyed) await Promise.race([scene.lost, delay(LOSS_MS)]);
  return scene.isDestroyed || scene.isLost;
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
