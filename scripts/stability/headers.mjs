/**
 * Headers of the catalog's files: number, title, who fails and its evidence, the request and the actual run, and the
 * passing condition.
 */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../lib/run.mjs';

const FOLDERS = ['tests/stability', 'tests/stability/browser'];

/** All rows in the order of their numbers. Throws for a file whose header lacks a part. */
export function readHeaders() {
  const rows = FOLDERS.flatMap(sourcesIn).map(readHeader).filter(Boolean);
  const order = ({ id }) => parseFloat(id.slice(1)) + (id.endsWith('b') ? 0.5 : 0);
  return rows.sort((a, b) => order(a) - order(b));
}

/** The files that Node runs, with the id of the row; the corpus of the fuzzer is no row. */
export const rowFiles = () => sourcesIn(FOLDERS[0]).map((file) => ({ file, id: readHeader(file)?.id }));

const sourcesIn = (folder) =>
  readdirSync(join(root, folder))
    .filter((name) => name.endsWith('.ts') && !['catalog.alone.lab.test.ts', 'support.ts'].includes(name))
    .map((name) => `${folder}/${name}`);

function readHeader(file) {
  const [, comment] = /^\/\*\*([\s\S]*?)\*\//.exec(readFileSync(join(root, file), 'utf8')) ?? [];
  const text = (comment ?? '').replace(/^ \* ?/gm, '').trim();
  const [, id, title] = /^(S\d+b?)\. (.+?)\.?$/m.exec(text) ?? [];
  if (id === undefined) return undefined;
  const part = (name) => {
    const [, found] = new RegExp(`^${name}: ([\\s\\S]*?)(?:\\n\\n|$(?![\\s\\S]))`, 'm').exec(text) ?? [];
    if (found === undefined) throw new Error(`${file}: its header does not say "${name}:"`);
    return found.replace(/\s+/g, ' ');
  };
  return { file, id, title, fails: part('Who fails'), recipe: part('Recipe'), passes: part('Passes') };
}
