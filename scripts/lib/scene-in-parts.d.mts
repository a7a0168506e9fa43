import type { GaussianCloud } from '@gaussian-splat/core';
import type { TaskPool } from '@gaussian-splat/economise';

export function readInThreads(path: string, pool: TaskPool): Promise<GaussianCloud>;
