import { loadModule } from '@gaussian-splat/core';
import type * as firstUse from './first-use.js';

/** Loads the tests of stages that few scenes need. */
export const loadFirstUse = (): Promise<typeof firstUse> =>
  loadModule('the GPU self-test', () => import('./first-use.js'));
