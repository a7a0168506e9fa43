import { readFileSync } from 'node:fs';

/** What a JSON file says, with or without the byte-order mark that some editors and shells put before it. */
export function readJson(path) {
  return JSON.parse(readFileSync(path, 'utf8').replace(/^\ufeff/, ''));
}
