/** Options of `codeClip` for a manifest, and processes that code ranges of its frames. This module is their script, too. */
import { fork } from 'node:child_process';
import { availableParallelism } from 'node:os';
import { basename, dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { codeClipRange, drawOn } from '@gaussian-splat/optimize';
import { framePath, parseSequence, readScene } from '@gaussian-splat/formats';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import { encodeWebp } from './encoders.mjs';
import { readerBeside, readWhole } from './input-file.mjs';
import { requestNodeDevice } from './node-gpu.mjs';
import { packError, unpackError } from './thread-errors.mjs';

const SCRIPT = fileURLToPath(import.meta.url);
/** Number of CPU cores for each process: the first group needs about as long as the others together. */
const [CORES, MAX_JOBS] = [5, 4];

/** Returns the default number of processes. */
export const usualJobs = () => Math.max(1, Math.min(MAX_JOBS, Math.floor(availableParallelism() / CORES)));

/**
 * Opens the frames of a manifest.
 * @param given {object} `manifest`, a path, and the options of `codeClip` that can be cloned.
 * @returns The sequence, the paths of its frames, and options of `codeClip` without a store.
 */
export async function openFrames({ manifest, ...given }) {
  const sequence = parseSequence(await readWhole(manifest), basename(manifest));
  const { frameCount, framesPerSecond } = sequence;
  const paths = Array.from({ length: frameCount }, (_, frame) => join(dirname(manifest), framePath(sequence, frame)));
  const openFrame = async (frame) => {
    const path = paths[frame];
    return readScene(await readWhole(path), { name: path, openFile: readerBeside(path) });
  };
  const draw = drawOn(await openDevice());
  return { sequence, paths, options: { ...given, frameCount, framesPerSecond, openFrame, draw, encodeWebp } };
}

/** Returns the {@link ClipJobs} of `count` processes with the arguments of {@link openFrames}. */
export function clipJobs(count, given, onStep) {
  const code = (range) =>
    new Promise((resolve, reject) => {
      const child = fork(SCRIPT, [], { serialization: 'advanced' });
      child.on('message', ({ step, state, error }) => {
        if (step !== undefined) onStep(step);
        else if (error) reject(unpackError(error));
        else resolve(state);
      });
      child.on('error', reject);
      child.on('exit', (status, signal) =>
        reject(new Error(`the process for frames ${range.begin} to ${range.end - 1} ended: ${signal ?? status}`)),
      );
      child.send({ given, range });
    });
  return { count, code };
}

async function openDevice() {
  const { device } = await requestNodeDevice({ isTrusted: true });
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function codeRange({ given, range }) {
  const send = (message) => new Promise((done) => process.send(message, done));
  try {
    const { options } = await openFrames(given);
    const onStep = (step) => void send({ step });
    await send({ state: await codeClipRange({ ...options, onStep }, range) });
  } catch (error) {
    await send({ error: packError(error) });
  }
  // Devices keep a process alive.
  process.exit(0);
}

if (process.argv[1] === SCRIPT && process.send) {
  process.once('message', codeRange);
  // The groups of a parent that has ended are not needed.
  process.once('disconnect', () => process.exit(1));
}
