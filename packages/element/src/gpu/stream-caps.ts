import { isHandheld } from './memory-budget.js';

/** What a device is trusted with for a streamed scene: phones end pages that take more. */
export interface StreamCaps {
  readonly splats: number;
  readonly bytes: number;
}

const PHONE: StreamCaps = { splats: 1e6, bytes: 160e6 };
const DESKTOP: StreamCaps = { splats: 3e6, bytes: 512e6 };

export const streamCaps = (): StreamCaps => (isHandheld() ? PHONE : DESKTOP);
