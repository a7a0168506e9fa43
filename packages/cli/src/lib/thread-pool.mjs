/**
 * Pool of threads with shared memory for the tasks of `@gaussian-splat/optimize`. It implements `TaskPool` of
 * packages/optimize/src/parts/task-pool.ts.
 */
import { existsSync } from 'node:fs';
import { availableParallelism } from 'node:os';
import { fileURLToPath } from 'node:url';
import { Worker } from 'node:worker_threads';
import { unpackError } from './thread-errors.mjs';

/** Maximum default number of threads. More threads have little effect, because the work is memory bound. */
const MAX_THREADS = 16;
/** Returns the default number of threads: one for each CPU core, up to {@link MAX_THREADS}. */
export const usualThreads = () => Math.min(MAX_THREADS, availableParallelism());

/**
 * Minimum number of splats for using threads. Fewer splats are processed before threads have started. The limit
 * was measured on two cores.
 */
const MIN_SPLATS = 1 << 18;

/**
 * Script of a thread, and its bundle in one file. Without the bundle, each thread loads a hundred modules, and takes five
 * times as long to start.
 */
const SOURCE = new URL('./task-thread.mjs', import.meta.url);
const BUNDLE = new URL('../../../../.cache/threads/task-thread.mjs', import.meta.url);

/** Returns the URL of the bundle if the last build has written it, otherwise of the source. */
const threadScript = () => (existsSync(BUNDLE) ? BUNDLE : SOURCE);

export class ThreadPool {
  /** Threads with their pending tasks, in order. */
  #threads = [];

  /**
   * @param size Number of threads. The first call of `run`, or `start`, starts them.
   * @param minSplats Minimum number of splats that callers process by the pool.
   */
  constructor(size = usualThreads(), minSplats = MIN_SPLATS) {
    this.size = size;
    this.minSplats = minSplats;
  }

  allocate(byteLength) {
    return new SharedArrayBuffer(byteLength);
  }

  shares(memory) {
    return memory instanceof SharedArrayBuffer;
  }

  /** Starts the threads before their first tasks. */
  start() {
    while (this.#threads.length < this.size) this.#threads.push(new TaskThread());
  }

  /** All tasks are posted at once, so that they run even while this thread is busy. */
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

/** A thread that runs its tasks in sequence, and returns their results in the same order. */
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
    // Idle threads do not keep the process alive.
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

/** Bundles the script of a thread. The packages must have been built. */
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
