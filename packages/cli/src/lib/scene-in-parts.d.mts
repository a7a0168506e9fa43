import type { GaussianCloud } from '@gaussian-splat/core';
import type { TaskPool } from '@gaussian-splat/optimize';

export function startReading(path: string, pool: TaskPool): Promise<{ readonly cloud: Promise<GaussianCloud> }>;
