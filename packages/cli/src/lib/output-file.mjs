/** Writer of the output files of commands, which are never partial and never replace an input file. */
import { randomUUID } from 'node:crypto';
import {
  accessSync,
  constants,
  existsSync,
  linkSync,
  mkdirSync,
  realpathSync,
  renameSync,
  rmSync,
  statSync,
  writeFileSync,
} from 'node:fs';
import { dirname, resolve } from 'node:path';
import { UsageError } from './command.mjs';

/** Whether two paths refer to the same file, directly or by links. */
export function isSameFile(a, b) {
  if (a === b) return true;
  if (!existsSync(a) || !existsSync(b)) return false;
  const [one, other] = [statSync(a), statSync(b)];
  return one.dev === other.dev && one.ino === other.ino;
}

/** Returns a description of why a file cannot be written; undefined if it can. */
export function obstacleTo(path) {
  const folder = dirname(path);
  if (!existsSync(folder)) return `the folder ${folder} does not exist`;
  if (existsSync(path) && statSync(path).isDirectory()) return `${path} is a folder`;
  if (!mayWrite(existsSync(path) ? path : folder)) return `${path} may not be written`;
}

/** Returns a description of why files cannot be written to a folder, which need not exist; undefined if they can. */
export function obstacleToFolder(path) {
  if (!existsSync(path)) return obstacleToFolder(dirname(path));
  if (!statSync(path).isDirectory()) return `${path} is not a folder`;
  if (!mayWrite(path)) return `${path} may not be written`;
}

/**
 * Checks before the work that an output can be written, and that it is none of the inputs.
 * @param inputs {Record<string, string | undefined>} Paths of the files that the command reads, by their names in messages.
 * @param obstacleOf {(path: string) => string | undefined} {@link obstacleTo}, or a function like it.
 * @throws UsageError
 */
export function checkOutput(option, path, inputs, obstacleOf = obstacleTo) {
  for (const [name, input] of Object.entries(inputs))
    if (input !== undefined && isSameFile(resolve(path), resolve(input)))
      throw new UsageError(`--${option}: expected another file than ${name}, which is never changed`);
  const obstacle = obstacleOf(resolve(path));
  if (obstacle) throw new UsageError(`--${option}: ${obstacle}`);
}

function mayWrite(path) {
  try {
    accessSync(path, constants.W_OK);
    return true;
  } catch {
    return false;
  }
}

/** Returns a name beside a file that no other process has: those of other machines and containers have the same numbers. */
const partOf = (path) => `${path}.${randomUUID().slice(0, 13)}.part`;

/** Writes a file, unless another process has done it meanwhile, whose file remains. */
export function writeOnce(path, content) {
  const part = partOf(path);
  try {
    writeFileSync(part, content);
    linkSync(part, path);
  } catch (error) {
    if (error.code === 'ENOSPC') throw error;
    // Some network drives have no links.
    if (!existsSync(path)) renameSync(part, path);
  } finally {
    rmSync(part, { force: true });
  }
}

/** Writes a file completely or not at all. An existing file remains until the new file is complete. */
export function writeWhole(path, content) {
  const target = existsSync(path) ? realpathSync(path) : path;
  // Pipes, devices, and files in read-only folders are written directly.
  if (existsSync(target) && !(statSync(target).isFile() && mayWrite(dirname(target))))
    return writeFileSync(target, content);
  const part = partOf(target);
  try {
    writeFileSync(part, content);
    renameSync(part, target);
  } catch (error) {
    rmSync(part, { force: true });
    throw error;
  }
}

/**
 * Writes files and the folders that they need, or nothing: after a failure, what was written is removed.
 * @param files {Iterable<readonly [path: string, content: string | Uint8Array]>} In this order.
 */
export function writeAll(files) {
  const made = [];
  try {
    for (const [path, content] of files) {
      made.push(mkdirSync(dirname(path), { recursive: true }) ?? path);
      writeWhole(path, content);
    }
  } catch (error) {
    for (const path of made) rmSync(path, { recursive: true, force: true });
    throw error;
  }
}
