import { MemoryLedger } from '@gaussian-splat/renderer';

/** Whether the page is on a phone or a tablet. */
export function isHandheld(): boolean {
  return globalThis.matchMedia?.('(pointer: coarse)').matches ?? false;
}

/**
 * Default limit of GPU memory in bytes for a scene, and for all scenes of a page together; undefined if nothing is
 * known about the device.
 */
export function defaultMemoryBudget(): number | undefined {
  // The GPU memory of a device is unknown; half of the memory is a safe limit for shared memory. Browsers round it, and
  // report at most 8 GB or so. Safari reports nothing, and terminates pages on phones that use too much.
  const { deviceMemory = isHandheld() ? 1 : undefined } = navigator as { deviceMemory?: number };
  return deviceMemory! > 0 ? deviceMemory! * 2 ** 29 : undefined;
}

/**
 * Default limit of CPU memory in bytes for a load: a splat takes several times as much there, as file and as numbers,
 * as on the GPU.
 */
export const loadBytes = (memoryBudget = Infinity): number => Math.min(8 * memoryBudget, 2 ** 32);

/** Limits set here, by device: any other value was set by the page, and stays. */
const set = new WeakMap<GPUDevice, number>();

/** Limits all scenes on a device together to the default of one, or to the page's limit if that is larger. */
export function limitScenes(device: GPUDevice, memoryBudget = 0): void {
  const ledger = MemoryLedger.of(device);
  if (ledger.budgetBytes !== (set.get(device) ?? Infinity)) return;
  limit(ledger, memoryBudget);
  set.set(device, ledger.budgetBytes);
}

/**
 * Limits the scenes of a ledger. Off-screen scenes are kept on desktops, so that scrolling back shows them at once, but
 * not on phones.
 */
export function limit(ledger: MemoryLedger, memoryBudget = 0): void {
  ledger.budgetBytes = Math.max(memoryBudget, defaultMemoryBudget() ?? Infinity);
  ledger.unseenBytes = isHandheld() ? 0 : ledger.budgetBytes / 4;
}
