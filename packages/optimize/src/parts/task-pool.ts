import type { Part } from './cloud-memory.js';
import { tasks } from './tasks.js';

export type { Part };

/** Tasks of this package by name. They are functions of plain data and typed arrays, which another thread can call. */
export type Tasks = typeof tasks;
export type TaskName = keyof Tasks;
export type TaskInput<Name extends TaskName> = Parameters<Tasks[Name]>[0];
export type TaskResult<Name extends TaskName> = Awaited<ReturnType<Tasks[Name]>>;

/** Pool that runs parallel tasks. {@link inline} runs them on the calling thread. Hosts with threads provide other pools. */
export interface TaskPool {
  /** Number of tasks that run in parallel. */
  readonly size: number;
  /** Minimum number of splats for using the pool. The calling thread processes fewer splats faster. */
  readonly minSplats: number;
  /** Allocates memory that both tasks and their caller can access. */
  allocate(byteLength: number): ArrayBufferLike;
  /** Whether tasks can access this memory directly. */
  shares(memory: ArrayBufferLike): boolean;
  /** Calls a task with each input, and returns the results in order. Rejects with the first error after all have ended. */
  run<Name extends TaskName>(name: Name, inputs: readonly TaskInput<Name>[]): Promise<TaskResult<Name>[]>;
}

/** Pool that runs tasks in sequence on the calling thread. */
export const inline: TaskPool = {
  size: 1,
  minSplats: 0,
  allocate: (byteLength) => new ArrayBuffer(byteLength),
  shares: () => true,
  async run<Name extends TaskName>(name: Name, inputs: readonly TaskInput<Name>[]): Promise<TaskResult<Name>[]> {
    const task = tasks[name] as (input: TaskInput<Name>) => TaskResult<Name> | Promise<TaskResult<Name>>;
    const results: TaskResult<Name>[] = [];
    for (const input of inputs) results.push(await task(input));
    return results;
  },
};

/** Minimum size of a part, as a fraction of {@link TaskPool.minSplats}. */
const MIN_SHARE = 1 / 8;

/** Divides `count` splats into parts of equal size, except the last. Empty without splats. */
export function partsOf(count: number, { size, minSplats }: TaskPool): Part[] {
  const wanted = Math.min(size, Math.floor(count / Math.max(1, MIN_SHARE * minSplats)));
  const step = Math.ceil(count / Math.max(1, wanted));
  const parts: Part[] = [];
  for (let first = 0; first < count; first += step) parts.push({ first, end: Math.min(count, first + step) });
  return parts;
}

/** Returns the pool; {@link inline} for fewer than `minSplats` splats, or if tasks would receive copies of arrays. */
export function poolFor(pool: TaskPool, count: number, arrays: readonly ArrayBufferView[] = []): TaskPool {
  return count >= pool.minSplats && arrays.every(({ buffer }) => pool.shares(buffer)) ? pool : inline;
}
