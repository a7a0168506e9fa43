/** Folder with the finished groups of a clip, beside the clip, while it is being encoded. */
import { existsSync, mkdirSync, readFileSync, rmSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { writeWhole } from './output-file.mjs';

const KEY = 'input.json';

/**
 * Opens the store of a clip. A store of other options or frames is emptied.
 * @param out {string} Path of the clip.
 * @param options {object} Options that determine the clip.
 * @param frames {string[]} Paths of the files of the frames.
 */
export function openClipStore(out, options, frames) {
  const folder = `${out}.unfinished`;
  const files = frames.map((path) => {
    const { size, mtimeMs } = statSync(path);
    return [path, size, mtimeMs];
  });
  const key = JSON.stringify({ options, files });
  const keyFile = join(folder, KEY);
  if (!existsSync(keyFile) || readFileSync(keyFile, 'utf8') !== key) {
    rmSync(folder, { recursive: true, force: true });
    mkdirSync(folder);
    writeWhole(keyFile, key);
  }
  return {
    read: async (name) =>
      existsSync(join(folder, name)) ? new Uint8Array(readFileSync(join(folder, name))) : undefined,
    write: async (name, bytes) => writeWhole(join(folder, name), bytes),
    remove: () => rmSync(folder, { recursive: true, force: true }),
  };
}
