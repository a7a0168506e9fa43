/** Reads a scene file in a thread of its own: see {@link readInThread}. */
import { dirname, join } from 'node:path';
import { isMainThread, parentPort, Worker, workerData } from 'node:worker_threads';
import { readScene } from '@gaussian-splat/formats';
import { readWhole } from './input-file.mjs';
import { packError, unpackError } from './thread-errors.mjs';

/** A scene file as a cloud in shared memory, read while the caller does something else. Rejects as `readScene` does, or with the error of the file system. */
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
  const openPart = (part) => readWhole(join(dirname(path), part));
  try {
    const cloud = await readScene(await readWhole(path), { name: path, openPart });
    parentPort.postMessage({ cloud: shared(cloud) });
  } catch (error) {
    parentPort.postMessage({ error: packError(error) });
  }
}

/** The same cloud in memory that threads share. */
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
