/**
 * Threads for the tasks of `@gaussian-splat/economise`, with shared memory: a `TaskPool`, see
 * packages/economise/src/parts/task-pool.ts.
 */
import { existsSync } from 'node:fs';
import { availableParallelism } from 'node:os';
import { fileURLToPath } from 'node:url';
import { Worker } from 'node:worker_threads';
import { unpackError } from './thread-errors.mjs';

/** Maximum number of threads: more hardly help, because most of the work is memory bound. */
const MAX_THREADS = 16;
/** One thread for each CPU core, up to the maximum. */
export const usualThreads = () => Math.min(MAX_THREADS, availableParallelism());

/**
 * Smaller work is done before threads have started and been compiled; measured on two cores, when the start of each
 * took a tenth of a second of CPU time (a third of that now).
 */
const MIN_SPLATS = 1 << 18;

/**
 * The script of a thread as one file: loading a hundred modules, on each of sixteen threads, takes five times as long
 * to start.
 */
const SOURCE = new URL('./task-thread.mjs', import.meta.url);
const BUNDLE = new URL('../../../../.cache/threads/task-thread.mjs', import.meta.url);

/** The bundle of the last build, else the source. */
const threadScript = () => (existsSync(BUNDLE) ? BUNDLE : SOURCE);

export class ThreadPool {
  /** Threads with their pending tasks, in order. */
  #threads = [];

  /**
   * @param size Number of threads; they are started by the first tasks, or by `start`.
   * @param minSplats Minimum number of splats for using them.
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

/** Bundles the script of a thread, once the packages are built. */
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
