import type { TaskPool } from '@gaussian-splat/economise';

export class ThreadPool implements TaskPool {
  constructor(size?: number);
  readonly size: number;
  allocate: TaskPool['allocate'];
  shares: TaskPool['shares'];
  run: TaskPool['run'];
  start(): void;
  close(): Promise<void>;
}
