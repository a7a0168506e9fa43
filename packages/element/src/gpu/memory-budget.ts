import { MemoryLedger } from '@gaussian-splat/renderer';

/** Whether the page is on a phone or a tablet. */
export function isHandheld(): boolean {
  return globalThis.matchMedia?.('(pointer: coarse)').matches ?? false;
}

/**
 * Bytes of GPU memory that a scene, and all of a page together, may take unless the page says otherwise; undefined where nothing is known of the device.
 */
export function defaultMemoryBudget(): number | undefined {
  // The GPU's share of a device is known to nobody; half of the memory is what shared memory can spare. Browsers round it, and end at 8 GB or more. Safari says
  // nothing, and ends pages on phones that take more than some of what there is.
  const { deviceMemory = isHandheld() ? 1 : undefined } = navigator as { deviceMemory?: number };
  return deviceMemory! > 0 ? deviceMemory! * 2 ** 29 : undefined;
}

/** Bytes of the page's memory that a load may take where the page says nothing: a splat takes several times as many there, as file and as numbers, as on the GPU. */
export const loadBytes = (memoryBudget = Infinity): number => Math.min(8 * memoryBudget, 2 ** 32);

/** What was set here, by device: another figure is the page's own, and stays. */
const set = new WeakMap<GPUDevice, number>();

/** Limits all scenes on a device together to what one may take by default, or by the page's word if that is more. */
export function limitScenes(device: GPUDevice, memoryBudget = 0): void {
  const ledger = MemoryLedger.of(device);
  if (ledger.budgetBytes !== (set.get(device) ?? Infinity)) return;
  limit(ledger, memoryBudget);
  set.set(device, ledger.budgetBytes);
}

/** Limits the scenes of a ledger. Out of sight a desktop keeps some, which are at once there when visitors scroll back; a phone keeps none. */
export function limit(ledger: MemoryLedger, memoryBudget = 0): void {
  ledger.budgetBytes = Math.max(memoryBudget, defaultMemoryBudget() ?? Infinity);
  ledger.unseenBytes = isHandheld() ? 0 : ledger.budgetBytes / 4;
}
