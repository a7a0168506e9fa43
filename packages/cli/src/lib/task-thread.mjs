/** A thread of a `ThreadPool`: does one task after another. */
import { parentPort } from 'node:worker_threads';
import { tasks } from '@gaussian-splat/economise/parts';
import { readFilePart } from './file-part.mjs';
import { packError } from './thread-errors.mjs';

const known = { ...tasks, readFilePart };
let last = Promise.resolve();

async function answer({ name, input }) {
  try {
    parentPort.postMessage({ result: await known[name](input) });
  } catch (error) {
    parentPort.postMessage({ error: packError(error) });
  }
}

parentPort.on('message', (task) => (last = last.then(() => answer(task))));
