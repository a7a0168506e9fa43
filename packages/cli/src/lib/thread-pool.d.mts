import type { TaskPool } from '@gaussian-splat/optimize';

export function usualThreads(): number;

export class ThreadPool implements TaskPool {
  constructor(size?: number, minSplats?: number);
  readonly size: number;
  readonly minSplats: number;
  allocate: TaskPool['allocate'];
  shares: TaskPool['shares'];
  run: TaskPool['run'];
  start(): void;
  close(): Promise<void>;
}
