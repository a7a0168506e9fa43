/** Module of a thread that reads a scene file, and {@link readInThread}, which starts this thread. */
import { isMainThread, parentPort, Worker, workerData } from 'node:worker_threads';
import { readScene } from '@gaussian-splat/formats';
import { readerBeside, readWhole } from './input-file.mjs';
import { packError, unpackError } from './thread-errors.mjs';

/**
 * Reads a scene file on another thread, and resolves to a cloud in shared memory. Rejects as `readScene` does, or with a
 * file system error.
 */
export function readInThread(path) {
  return new Promise((resolve, reject) => {
    const thread = new Worker(new URL(import.meta.url), { workerData: path });
    thread.once('error', reject);
    thread.once('message', ({ cloud, error }) => {
      if (cloud) resolve(cloud);
      else reject(unpackError(error));
    });
  });
}

async function answer(path) {
  try {
    const cloud = await readScene(await readWhole(path), { name: path, openFile: readerBeside(path) });
    parentPort.postMessage({ cloud: shared(cloud) });
  } catch (error) {
    parentPort.postMessage({ error: packError(error) });
  }
}

/** Returns a copy of a cloud whose arrays are in shared memory. */
function shared(cloud) {
  const entries = Object.entries(cloud).map(([name, value]) => {
    if (!(value instanceof Float32Array)) return [name, value];
    const numbers = new Float32Array(new SharedArrayBuffer(value.byteLength));
    numbers.set(value);
    return [name, numbers];
  });
  return Object.fromEntries(entries);
}

if (!isMainThread) await answer(workerData);
