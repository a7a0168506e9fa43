/** Writes the files of the wheel: the view of the widget, the element in one module, and their licenses. */
import { cpSync, existsSync, mkdirSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const at = (path) => fileURLToPath(new URL(path, import.meta.url));
const FILES = {
  'widget.js': 'js/widget.js',
  'element.js': '../cli/dist/single.js',
  'LICENSES.txt': '../element/cdn/LICENSES.txt',
};

export function writeStatic() {
  const folder = at('src/gaussian_notebook/static');
  mkdirSync(folder, { recursive: true });
  for (const [name, from] of Object.entries(FILES)) {
    if (!existsSync(at(from))) throw new Error(`${from} is missing: run "npm run build -- --element" first`);
    cpSync(at(from), `${folder}/${name}`);
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) writeStatic();
