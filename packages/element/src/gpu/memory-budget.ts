import { MemoryLedger } from '@gaussian-splat/renderer';
import type { FileRequest } from '../loading/protocol.js';

/** Returns whether the primary pointer is coarse, as on phones and tablets. */
export function isHandheld(): boolean {
  return globalThis.matchMedia?.('(pointer: coarse)').matches ?? false;
}

/**
 * Returns the default limit of GPU memory in bytes, for one scene and for all scenes of a page together; undefined if
 * nothing is known about the device.
 */
export function defaultMemoryBudget(): number | undefined {
  // The GPU memory of a device is unknown. Half of the main memory is a safe limit if the GPU shares it. Browsers round
  // the main memory, and report at most about 8 GB. Safari reports nothing, and terminates pages on phones that use too
  // much, so 1 GB is assumed there.
  const { deviceMemory = isHandheld() ? 1 : undefined } = navigator as { deviceMemory?: number };
  return deviceMemory! > 0 ? deviceMemory! * 2 ** 29 : undefined;
}

/**
 * Returns the default limit of CPU memory for a load, in bytes. A splat takes several times as much CPU memory, in the
 * file and as numbers, as GPU memory.
 */
const loadBytes = (memoryBudget = Infinity): number => Math.min(8 * memoryBudget, 2 ** 32);

/** Returns a request with a limit of bytes: the request's own, or the default. */
export const limited = <T extends FileRequest>(request: T, memoryBudget: number | undefined): T => ({
  ...request,
  limits: { maxBytes: loadBytes(memoryBudget), ...request.limits },
});

/** Limits that {@link limitScenes} has set, by device. Any other limit was set by the page, and is kept. */
const set = new WeakMap<GPUDevice, number>();

/**
 * Limits all scenes on a device together to the default limit of one scene, or to `memoryBudget` in bytes, if that is
 * larger. Has no effect if the page has set a limit.
 */
export function limitScenes(device: GPUDevice, memoryBudget = 0): void {
  const ledger = MemoryLedger.of(device);
  if (ledger.budgetBytes !== (set.get(device) ?? Infinity)) return;
  limit(ledger, memoryBudget);
  set.set(device, ledger.budgetBytes);
}

/**
 * Sets the limits of a ledger. On desktops, off-screen scenes may keep a quarter of the memory, so that scrolling back
 * shows them at once. On phones they are released.
 */
export function limit(ledger: MemoryLedger, memoryBudget = 0): void {
  ledger.budgetBytes = Math.max(memoryBudget, defaultMemoryBudget() ?? Infinity);
  ledger.unseenBytes = isHandheld() ? 0 : ledger.budgetBytes / 4;
}
