import type { Part } from './cloud-memory.js';
import { tasks } from './tasks.js';

export type { Part };

/** The tasks of this package, by their names: functions of plain data and typed arrays, which another thread can call. */
export type Tasks = typeof tasks;
export type TaskName = keyof Tasks;
export type TaskInput<Name extends TaskName> = Parameters<Tasks[Name]>[0];
export type TaskResult<Name extends TaskName> = Awaited<ReturnType<Tasks[Name]>>;

/** Where work is done that comes in parts. {@link inline} does it where it is asked for; a host that has threads gives another. */
export interface TaskPool {
  /** How many parts are done at the same time. */
  readonly size: number;
  /** Work on fewer splats is done sooner by the thread that has it than here. */
  readonly leastSplats: number;
  /** Memory that tasks share with the thread that asks for them. */
  allocate(byteLength: number): ArrayBufferLike;
  /** True if tasks see this memory as it is, and write to it. */
  shares(memory: ArrayBufferLike): boolean;
  /** Does a task with each of some inputs. Rejects with the first one's error, once all have ended. */
  run<Name extends TaskName>(name: Name, inputs: readonly TaskInput<Name>[]): Promise<TaskResult<Name>[]>;
}

/** Does one part after another, in this thread. */
export const inline: TaskPool = {
  size: 1,
  leastSplats: 0,
  allocate: (byteLength) => new ArrayBuffer(byteLength),
  shares: () => true,
  async run<Name extends TaskName>(name: Name, inputs: readonly TaskInput<Name>[]): Promise<TaskResult<Name>[]> {
    const task = tasks[name] as (input: TaskInput<Name>) => TaskResult<Name> | Promise<TaskResult<Name>>;
    const results: TaskResult<Name>[] = [];
    for (const input of inputs) results.push(await task(input));
    return results;
  },
};

/** Parts of {@link TaskPool.leastSplats} that are a part of their own at least. */
const LEAST_SHARE = 1 / 8;

/** So many splats in parts of one size, but for the last. None if there are no splats. */
export function partsOf(count: number, { size, leastSplats }: TaskPool): Part[] {
  const wanted = Math.min(size, Math.floor(count / Math.max(1, LEAST_SHARE * leastSplats)));
  const step = Math.ceil(count / Math.max(1, wanted));
  const parts: Part[] = [];
  for (let first = 0; first < count; first += step) parts.push({ first, end: Math.min(count, first + step) });
  return parts;
}

/** The pool, or none for work that is too small for it, or where its tasks would get copies of what arrays hold. */
export function poolFor(pool: TaskPool, count: number, arrays: readonly ArrayBufferView[] = []): TaskPool {
  return count >= pool.leastSplats && arrays.every(({ buffer }) => pool.shares(buffer)) ? pool : inline;
}
