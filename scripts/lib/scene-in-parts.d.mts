import type { GaussianCloud } from '@gaussian-splat/core';
import type { ThreadPool } from './thread-pool.mjs';

export function readInThreads(path: string, pool: ThreadPool): Promise<GaussianCloud>;
