/** What a scene's life knows of devices that are lost. */
import { GaussianSplatError } from '@gaussian-splat/core';
import type { Painter } from './painter.js';

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

/** Whether what failed did so because frames are no longer drawn, or the device was lost. */
export async function isGone(painter: Pick<Painter, 'isDestroyed' | 'isLost'>): Promise<boolean> {
  if (!painter.isDestroyed && !painter.isLost) await delay(LOSS_MS);
  return painter.isDestroyed || painter.isLost;
}

/** Whether the device was lost before all that was submitted was done. */
export async function wasLost(painter: Pick<Painter, 'finished' | 'isLost'>): Promise<boolean> {
  await painter.finished();
  // The loss is told a little later.
  await new Promise((resolve) => setTimeout(resolve));
  return painter.isLost;
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
