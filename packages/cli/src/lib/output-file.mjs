/** Output files of commands: never partial, and never over an input file. */
import { accessSync, constants, existsSync, realpathSync, renameSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { dirname } from 'node:path';

/** Whether two paths refer to one file, also through links. */
export function isSameFile(a, b) {
  if (a === b) return true;
  if (!existsSync(a) || !existsSync(b)) return false;
  const [one, other] = [statSync(a), statSync(b)];
  return one.dev === other.dev && one.ino === other.ino;
}

/** Describes why a file cannot be written, or returns undefined, to be reported before the work. */
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

/** Writes a file completely or not at all: an existing file stays until the new one is on the disk. */
export function writeWhole(path, content) {
  const target = existsSync(path) ? realpathSync(path) : path;
  // Pipes, devices, and files in read-only folders are written directly.
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
