import { perDevice } from './kernel.js';

/** The self-test of a device, for kernels that are loaded after its first run; `run` is undefined before. */
export const selfTestOf = (device: GPUDevice): { run?: (tested: string) => Promise<boolean> } =>
  perDevice(device, 'self-test', () => ({}));
