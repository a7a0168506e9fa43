/** Threads that do the tasks of `@gaussian-splat/economise`, in memory that they share: a `TaskPool`, see packages/economise/src/parts/task-pool.ts. */
import { existsSync } from 'node:fs';
import { availableParallelism } from 'node:os';
import { fileURLToPath } from 'node:url';
import { Worker } from 'node:worker_threads';
import { unpackError } from './thread-errors.mjs';

/** More threads have little to gain: most of the work is moving memory. */
const MOST_THREADS = 16;
/** One for each processor, up to so many. */
export const usualThreads = () => Math.min(MOST_THREADS, availableParallelism());

/** Fewer splats are done before threads are started and have run themselves in; measured on two cores, when starting took each a tenth of a second of a processor (a third of that now). */
const LEAST_SPLATS = 1 << 18;

/** The script of a thread, in one file: a thread that loads a hundred modules, as every one of sixteen does, takes five times as long to start. */
const SOURCE = new URL('./task-thread.mjs', import.meta.url);
const BUNDLE = new URL('../../../../.cache/threads/task-thread.mjs', import.meta.url);

/** Where it is: what the last build made of it, else its source. */
const threadScript = () => (existsSync(BUNDLE) ? BUNDLE : SOURCE);

export class ThreadPool {
  /** Each with the tasks that it has not answered yet, in their order. */
  #threads = [];

  /**
   * @param size threads; they are started by the first tasks, or by `start`
   * @param leastSplats that they are given work on
   */
  constructor(size = usualThreads(), leastSplats = LEAST_SPLATS) {
    this.size = size;
    this.leastSplats = leastSplats;
  }

  allocate(byteLength) {
    return new SharedArrayBuffer(byteLength);
  }

  shares(memory) {
    return memory instanceof SharedArrayBuffer;
  }

  /** Starts the threads ahead of the tasks that they will get. */
  start() {
    while (this.#threads.length < this.size) this.#threads.push(new TaskThread());
  }

  /** All tasks are handed out at once, so that they are done also while this thread is kept busy. */
  async run(name, inputs) {
    this.start();
    const answers = inputs.map((input, k) => this.#threads[k % this.size].ask(name, input));
    await Promise.allSettled(answers);
    return Promise.all(answers);
  }

  /** Ends the threads. */
  async close() {
    await Promise.all(this.#threads.splice(0).map((thread) => thread.close()));
  }
}

/** A thread that answers in the order of its tasks. */
class TaskThread {
  #worker = new Worker(threadScript());
  #open = [];

  constructor() {
    this.#worker.on('message', ({ result, error }) => {
      const { resolve, reject } = this.#open.shift();
      if (this.#open.length === 0) this.#worker.unref();
      if (error) reject(unpackError(error));
      else resolve(result);
    });
    const fail = (error) => this.#open.splice(0).forEach(({ reject }) => reject(error));
    this.#worker.on('error', fail);
    this.#worker.on('exit', () => fail(new Error('the thread ended before its task was done')));
    // Threads without a task keep nobody waiting.
    this.#worker.unref();
  }

  ask(name, input) {
    return new Promise((resolve, reject) => {
      this.#open.push({ resolve, reject });
      this.#worker.ref();
      this.#worker.postMessage({ name, input });
    });
  }

  close() {
    return this.#worker.terminate();
  }
}

/** Makes the script of a thread, once the packages are built. */
export async function bundleThreadScript() {
  const { build } = await import('esbuild');
  await build({
    entryPoints: [fileURLToPath(SOURCE)],
    outfile: fileURLToPath(BUNDLE),
    bundle: true,
    format: 'esm',
    platform: 'node',
    logLevel: 'warning',
  });
}
