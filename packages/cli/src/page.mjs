/**
 * `gaussian-splat page SCENE FOLDER [--single] [--port 8000] [--no-serve]`: a page with your own scene. Copies the
 * element and the scene to FOLDER, writes an index.html unless there is one, and serves the folder. The result is
 * static, so any host can serve it. With `--single` the index.html contains the element and the scene, and can be
 * opened from a disk or sent by mail.
 */
import { cpSync, existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { basename, dirname, extname, join, relative, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { filesBeside } from './lib/files-beside.mjs';
import { serve } from './lib/server.mjs';

const USAGE = 'gaussian-splat page SCENE FOLDER [--single] [--port 8000] [--no-serve]';
const elementFile = (path) => fileURLToPath(new URL(path, import.meta.resolve('@gaussian-splat/element/package.json')));
const CDN = elementFile('cdn');
/** The element in one module, including its late-loaded chunks. */
const ELEMENT = new URL('../dist/single.js', import.meta.url);
const SCRIPT = '<script type="module" src="cdn/gaussian-splat.min.js"></script>';

const { scene, folder, port, isServed, isSingle } = parseOptions();
const page = join(folder, 'index.html');

mkdirSync(folder, { recursive: true });
if (isSingle) await writeSingle();
else await writeFolder();
console.log(`\nThe page is ${isSingle ? page : `in ${folder}`}`);
if (isServed) await show();

async function writeFolder() {
  copyElement(join(folder, 'cdn'));
  const tag = tagOf(await copyScene());
  if (existsSync(page))
    console.log(`\n${page} is there already and stays as it is. Paste into it:\n\n${SCRIPT}\n${tag}`);
  else writeFileSync(page, htmlOf(SCRIPT, tag, titleOf(basename(scene))));
}

/**
 * Embeds the element and the scene as text in the page. The scene becomes a file with its name again, because the name
 * identifies some formats.
 */
async function writeSingle() {
  if (existsSync(page)) stop(`${page} is there already. With --single name a folder without one.`);
  const { found, missing } = await filesBeside(scene);
  if (isJson(scene) || found.length + missing.length > 0 || extname(scene) === '.onnx')
    stop(
      `${scene} is of several files, or needs ONNX Runtime. --single takes a scene of one file: PLY, SPZ, SOG, .splat, .ksplat or GLB.`,
    );
  const title = titleOf(scene);
  const name = JSON.stringify(basename(scene)).replaceAll('<', '\\u003c');
  const licenses = readFileSync(join(CDN, 'LICENSES.txt'), 'utf8').replaceAll('--', '- -');
  const script = `<!--\n${licenses}-->
  <script type="text/plain" id="scene">${readFileSync(scene).toString('base64')}</script>
  <script type="module">${readFileSync(ELEMENT, 'utf8').replaceAll(/<(?=\/script|!--)/gi, '\\x3c')}</script>
  <script type="module">
    const data = await fetch('data:application/octet-stream;base64,' + document.getElementById('scene').textContent);
    document.querySelector('gaussian-splat').src = new File([await data.blob()], ${name});
  </script>`;
  writeFileSync(page, htmlOf(script, `<gaussian-splat alt="${title}" camera-controls></gaussian-splat>`, title));
}

function parseOptions() {
  const flag = { type: 'boolean', default: false };
  const options = { port: { type: 'string', default: '8000' }, 'no-serve': flag, single: flag, help: flag };
  let parsed;
  try {
    parsed = parseArgs({ allowPositionals: true, options });
  } catch (error) {
    stop(`${error.message}. ${USAGE}`);
  }
  const { values, positionals } = parsed;
  if (values.help) {
    console.log(`usage: ${USAGE}`);
    process.exit(0);
  }
  if (positionals.length !== 2) stop(`A scene and a folder are needed: ${USAGE}`);
  // npm runs scripts in the repository's root, independent of the current folder.
  const [scene, folder] = positionals.map((path) => resolve(process.env.INIT_CWD ?? '.', path));
  if (!existsSync(scene)) stop(`There is no file ${scene}. ${USAGE}`);
  if (!statSync(scene).isFile()) stop(`${scene} is a folder: name the scene's file in it. ${USAGE}`);
  if (existsSync(folder) && !statSync(folder).isDirectory()) stop(`${folder} is a file: a folder is needed. ${USAGE}`);
  const port = Number(values.port);
  if (!(Number.isInteger(port) && port >= 0 && port < 65536))
    stop(`--port: expected a number from 0 to 65535, found "${values.port}". ${USAGE}`);
  return { scene, folder, port, isServed: !values['no-serve'] && !values.single, isSingle: values.single };
}

function stop(message) {
  console.error(message);
  process.exit(1);
}

/** ONNX Runtime has 43 MB and is needed only for generators; source maps are for developers of the element. */
function copyElement(target) {
  const isNeeded = (path) => {
    const inside = relative(CDN, path);
    return !inside.endsWith('.map') && (extname(scene) === '.onnx' || !inside.startsWith('onnxruntime'));
  };
  cpSync(CDN, target, { recursive: true, filter: isNeeded });
}

/**
 * Copies the scene with only the files that it names, and returns its path from the page. A scene described by a JSON
 * keeps its folder's name, because its files have the same names in every scene.
 */
async function copyScene() {
  const [name, from] = [basename(scene), dirname(scene)];
  const { found, missing } = await filesBeside(scene);
  if (missing.length > 0) console.warn(`${name} names files that were not copied: ${missing.join(', ')}`);
  const own = isJson(scene) && from !== folder ? basename(from) : '';
  const to = join(folder, own);
  // Dereferenced, because links would lead out of the folder.
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

function htmlOf(script, tag, title) {
  return `<!doctype html>
<html lang="en">
  <meta charset="utf-8" />
  <meta name="viewport" content="width=device-width, initial-scale=1" />
  <title>${title}</title>
  <style>
    gaussian-splat { display: block; width: 100%; height: 80vh; background: #ddd; }
  </style>
  ${tag}
  ${script}
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
