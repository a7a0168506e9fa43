/** Files that a command writes: never half of one, and never in place of one that it reads. */
import { accessSync, constants, existsSync, realpathSync, renameSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { dirname } from 'node:path';

/** Whether two paths lead to one file, by links too. */
export function isSameFile(a, b) {
  if (a === b) return true;
  if (!existsSync(a) || !existsSync(b)) return false;
  const [one, other] = [statSync(a), statSync(b)];
  return one.dev === other.dev && one.ino === other.ino;
}

/** What stands in the way of writing a file, for people, or undefined: to be said before the work. */
export function obstacleTo(path) {
  const folder = dirname(path);
  if (!existsSync(folder)) return `the folder ${folder} does not exist`;
  if (existsSync(path) && statSync(path).isDirectory()) return `${path} is a folder`;
  try {
    accessSync(existsSync(path) ? path : folder, constants.W_OK);
  } catch (error) {
    return `${path} cannot be written (${error.code})`;
  }
}

/** Writes a file whole or not at all: what is there stays until all of the new one is on the disk. */
export function writeWhole(path, content) {
  const target = existsSync(path) ? realpathSync(path) : path;
  // Pipes and devices are not replaced.
  if (existsSync(target) && !statSync(target).isFile()) return writeFileSync(target, content);
  const part = `${target}.${process.pid}.part`;
  try {
    writeFileSync(part, content);
    renameSync(part, target);
  } catch (error) {
    rmSync(part, { force: true });
    throw error;
  }
}
