/** Module of a thread of a `ThreadPool`, which runs tasks in sequence. */
import { closeSync, openSync, readSync } from 'node:fs';
import { parentPort } from 'node:worker_threads';
import { readBlocks, tasks } from '@gaussian-splat/optimize/parts';
import { readPrefix } from '@gaussian-splat/formats';
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

/**
 * Task of scene-in-parts.mjs: reads a range of the rows of a PLY file into the arrays of a cloud. Each block of rows is
 * read as a separate file: the header, followed by the rows.
 * @param head Bytes of the file up to its first row.
 */
async function readFilePart({ path, head, rowBytes, part, to }) {
  const file = openSync(path);
  let room = new Uint8Array(0);
  try {
    return await readBlocks(part, to, ({ first, end }) => {
      const byteLength = head.length + rowBytes * (end - first);
      if (room.length < byteLength) {
        room = new Uint8Array(byteLength);
        room.set(head);
      }
      fill(file, room.subarray(head.length, byteLength), head.length + rowBytes * first);
      return readPrefix(room.subarray(0, byteLength), { name: path });
    });
  } finally {
    closeSync(file);
  }
}

function fill(file, bytes, from) {
  for (let at = 0; at < bytes.length;) {
    const length = readSync(file, bytes, at, bytes.length - at, from + at);
    if (length === 0) throw new Error(`the file ended at byte ${from + at}: it has changed while it was read`);
    at += length;
  }
}
