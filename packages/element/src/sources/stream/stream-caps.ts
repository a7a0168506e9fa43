import { isHandheld } from '../../gpu/memory-budget.js';

/**
 * Limits of a streamed scene: number of splats, and bytes of GPU memory. They depend on the device, because phones
 * terminate pages that use more.
 */
export interface StreamCaps {
  readonly splats: number;
  readonly bytes: number;
}

const PHONE: StreamCaps = { splats: 1e6, bytes: 160e6 };
const DESKTOP: StreamCaps = { splats: 3e6, bytes: 512e6 };

export const streamCaps = (): StreamCaps => (isHandheld() ? PHONE : DESKTOP);
