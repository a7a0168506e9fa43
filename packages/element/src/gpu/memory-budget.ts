/** Bytes of GPU memory that a scene may take unless the page says otherwise; undefined where nothing is known of the device. */
export function defaultMemoryBudget(): number | undefined {
  // The GPU's share of a device is known to nobody; half of the memory is what shared memory can spare. Browsers round it, and end at 8 GB or more.
  const { deviceMemory } = navigator as { deviceMemory?: number };
  return deviceMemory === undefined ? undefined : deviceMemory * 2 ** 29;
}
