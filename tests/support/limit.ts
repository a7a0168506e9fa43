/**
 * Limits that depend on the adapter. SwiftShader gives the same numbers on every machine, so its limits lie just beyond them, and a change that costs accuracy is
 * seen by its author. Other adapters round and blend in their own ways, and keep the limits that are promised everywhere.
 */
export interface Limit {
  readonly swiftshader: number;
  readonly hardware: number;
}

/** Whether a device draws on SwiftShader; false on any other adapter, including other software adapters. */
export function isSwiftShader({ adapterInfo }: GPUDevice): boolean {
  const { vendor, architecture, device, description } = adapterInfo;
  return /swiftshader/i.test([vendor, architecture, device, description].join(' '));
}

/** The limit that holds on a device. */
export const limitOn = (device: GPUDevice, { swiftshader, hardware }: Limit): number =>
  isSwiftShader(device) ? swiftshader : hardware;
