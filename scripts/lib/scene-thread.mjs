/** Reads a scene file in a thread of its own: see {@link readInThread}. */
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { isMainThread, parentPort, Worker, workerData } from 'node:worker_threads';
import { GaussianSplatError } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { readWhole } from './read-whole.mjs';

/** A scene file as a cloud, read while the caller does something else. Rejects as `readScene` does, or with the error of the file system. */
export function readInThread(path) {
  return new Promise((resolve, reject) => {
    const thread = new Worker(new URL(import.meta.url), { workerData: path });
    thread.once('error', reject);
    thread.once('message', ({ cloud, data, message, code }) => {
      if (cloud) resolve(cloud);
      else reject(data ? GaussianSplatError.fromData(data) : Object.assign(new Error(message), { code }));
    });
  });
}

async function answer(path) {
  const openPart = async (part) => new Uint8Array(readFileSync(join(dirname(path), part)));
  try {
    const cloud = await readScene(await readWhole(path), { name: path, openPart });
    const arrays = Object.values(cloud).filter((value) => ArrayBuffer.isView(value));
    parentPort.postMessage({ cloud }, [...new Set(arrays.map(({ buffer }) => buffer))]);
  } catch (error) {
    const { message, code } = error;
    parentPort.postMessage(error instanceof GaussianSplatError ? { data: error.toData() } : { message, code });
  }
}

if (!isMainThread) await answer(workerData);
