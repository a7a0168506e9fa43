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
  if (!mayWrite(existsSync(path) ? path : folder)) return `${path} may not be written`;
}

function mayWrite(path) {
  try {
    accessSync(path, constants.W_OK);
    return true;
  } catch {
    return false;
  }
}

/** Writes a file whole or not at all: what is there stays until all of the new one is on the disk. */
export function writeWhole(path, content) {
  const target = existsSync(path) ? realpathSync(path) : path;
  // Neither pipes and devices are replaced, nor a file in a folder that nothing can be added to.
  if (existsSync(target) && !(statSync(target).isFile() && mayWrite(dirname(target))))
    return writeFileSync(target, content);
  const part = `${target}.${process.pid}.part`;
  try {
    writeFileSync(part, content);
    renameSync(part, target);
  } catch (error) {
    rmSync(part, { force: true });
    throw error;
  }
}
