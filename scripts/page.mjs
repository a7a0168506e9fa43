/**
 * `npm run page -- SCENE FOLDER [--port 8000] [--no-serve]`: a page with a scene of one's own. Builds the element if it is not built, puts it and the scene into
 * FOLDER, writes an index.html unless there is one, and serves the folder. What then lies there is static: any host can have it.
 */
import { copyFileSync, cpSync, existsSync, mkdirSync, writeFileSync } from 'node:fs';
import { basename, dirname, extname, join, relative, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { ensureDependencies, ensureElement } from './lib/prepare.mjs';
import { root } from './lib/run.mjs';
import { serve } from './lib/server.mjs';

const USAGE = 'npm run page -- SCENE FOLDER [--port 8000] [--no-serve]';
const CDN = join(root, 'packages/element/cdn');
const SCRIPT = '<script type="module" src="cdn/gaussian-splat.min.js"></script>';

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: { port: { type: 'string', default: '8000' }, 'no-serve': { type: 'boolean', default: false } },
});
// npm runs scripts in the repository's root, wherever it was called.
const [scene, folder] = positionals.map((path) => resolve(process.env.INIT_CWD ?? '.', path));
if (folder === undefined) stop(`A scene and a folder are needed: ${USAGE}`);
if (!existsSync(scene)) stop(`There is no file ${scene}. ${USAGE}`);

ensureDependencies();
ensureElement();
mkdirSync(folder, { recursive: true });
copyElement(join(folder, 'cdn'));
const tag = tagOf(copyScene());
const page = join(folder, 'index.html');
if (existsSync(page)) console.log(`\n${page} is there already and stays as it is. Paste into it:\n\n${SCRIPT}\n${tag}`);
else writeFileSync(page, htmlOf(tag));
console.log(`\nThe page is in ${folder}`);
if (!values['no-serve']) await show();

function stop(message) {
  console.error(message);
  process.exit(1);
}

/** ONNX Runtime has 43 MB and is for generators alone; maps are for those who work on the element. */
function copyElement(target) {
  const isNeeded = (path) => {
    const inside = relative(CDN, path);
    return !inside.endsWith('.map') && (extname(scene) === '.onnx' || !inside.startsWith('onnxruntime'));
  };
  cpSync(CDN, target, { recursive: true, filter: isNeeded });
}

/** Where the scene then lies, seen from the page. A scene of several files is told by a JSON among them, and brings its folder. */
function copyScene() {
  const name = basename(scene);
  if (extname(scene) !== '.json') {
    if (scene !== join(folder, name)) copyFileSync(scene, join(folder, name));
    return name;
  }
  const from = dirname(scene);
  const to = join(folder, basename(from));
  if (from !== to) cpSync(from, to, { recursive: true });
  return `${basename(from)}/${name}`;
}

function titleOf(source) {
  const file = extname(source) === '.json' ? dirname(source) : basename(source, extname(source));
  return file.replaceAll('&', '&amp;').replaceAll('"', '&quot;').replaceAll('<', '&lt;');
}

function tagOf(source) {
  const address = source.split('/').map(encodeURIComponent).join('/');
  return `<gaussian-splat src="${address}" alt="${titleOf(source)}" camera-controls></gaussian-splat>`;
}

function htmlOf(tag) {
  return `<!doctype html>
<html lang="en">
  <meta charset="utf-8" />
  <meta name="viewport" content="width=device-width, initial-scale=1" />
  <title>${/alt="([^"]*)"/.exec(tag)[1]}</title>
  ${SCRIPT}
  <style>
    gaussian-splat { display: block; width: 100%; height: 80vh; background: #ddd; }
  </style>
  ${tag}
</html>
`;
}

async function show() {
  const mounts = { '/': folder };
  const server = await serve(mounts, { port: Number(values.port) }).catch((error) => {
    if (error.code !== 'EADDRINUSE') throw error;
    return serve(mounts);
  });
  console.log(`and at http://localhost:${server.address().port}/ (Ctrl+C ends it)\n`);
}
