/**
 * `gaussian-splat page SCENE FOLDER [--port 8000] [--no-serve]`: a page with a scene of one's own. Puts the element and the scene into
 * FOLDER, writes an index.html unless there is one, and serves the folder. What then lies there is static: any host can have it.
 */
import { cpSync, existsSync, mkdirSync, statSync, writeFileSync } from 'node:fs';
import { basename, dirname, extname, join, relative, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { filesBeside } from './lib/files-beside.mjs';
import { serve } from './lib/server.mjs';

const USAGE = 'gaussian-splat page SCENE FOLDER [--port 8000] [--no-serve]';
const CDN = fileURLToPath(new URL('cdn', import.meta.resolve('@gaussian-splat/element/package.json')));
const SCRIPT = '<script type="module" src="cdn/gaussian-splat.min.js"></script>';

const { scene, folder, port, isServed } = parseOptions();

mkdirSync(folder, { recursive: true });
copyElement(join(folder, 'cdn'));
const tag = tagOf(await copyScene());
const page = join(folder, 'index.html');
if (existsSync(page)) console.log(`\n${page} is there already and stays as it is. Paste into it:\n\n${SCRIPT}\n${tag}`);
else writeFileSync(page, htmlOf(tag));
console.log(`\nThe page is in ${folder}`);
if (isServed) await show();

function parseOptions() {
  const options = { port: { type: 'string', default: '8000' }, 'no-serve': { type: 'boolean', default: false } };
  let parsed;
  try {
    parsed = parseArgs({ allowPositionals: true, options });
  } catch (error) {
    stop(`${error.message}. ${USAGE}`);
  }
  const { values, positionals } = parsed;
  if (positionals.length !== 2) stop(`A scene and a folder are needed: ${USAGE}`);
  // npm runs scripts in the repository's root, wherever it was called.
  const [scene, folder] = positionals.map((path) => resolve(process.env.INIT_CWD ?? '.', path));
  if (!existsSync(scene)) stop(`There is no file ${scene}. ${USAGE}`);
  if (!statSync(scene).isFile()) stop(`${scene} is a folder: name the scene's file in it. ${USAGE}`);
  if (existsSync(folder) && !statSync(folder).isDirectory()) stop(`${folder} is a file: a folder is needed. ${USAGE}`);
  const port = Number(values.port);
  if (!(Number.isInteger(port) && port >= 0 && port < 65536))
    stop(`--port: expected a number from 0 to 65535, found "${values.port}". ${USAGE}`);
  return { scene, folder, port, isServed: !values['no-serve'] };
}

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

/**
 * Where the scene then lies, seen from the page, with the files that it names and no others. One that a JSON describes keeps its folder's name, for its files are called alike in
 * every scene.
 */
async function copyScene() {
  const [name, from] = [basename(scene), dirname(scene)];
  const { found, missing } = await filesBeside(scene);
  if (missing.length > 0) console.warn(`${name} names files that were not copied: ${missing.join(', ')}`);
  const own = isJson(scene) && from !== folder ? basename(from) : '';
  const to = join(folder, own);
  // Links would lead out of the folder.
  if (from !== to) for (const file of [name, ...found]) cpSync(join(from, file), join(to, file), { dereference: true });
  return own === '' ? name : `${own}/${name}`;
}

function isJson(path) {
  return extname(path).toLowerCase() === '.json';
}

function titleOf(source) {
  const file = isJson(source) ? basename(dirname(scene)) : basename(source, extname(source));
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
  const server = await serve(mounts, { port }).catch((error) => {
    if (error.code !== 'EADDRINUSE') throw error;
    return serve(mounts);
  });
  console.log(`and at http://localhost:${server.address().port}/ (Ctrl+C ends it)\n`);
}
