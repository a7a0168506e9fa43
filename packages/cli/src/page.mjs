/**
 * Implementation of `gaussian-splat page SCENE FOLDER [--single] [--port 8000] [--no-serve]`. Copies the element and a
 * scene to FOLDER, writes an index.html unless one exists, and serves the folder. Any static host can serve the result.
 * With `--single`, the index.html contains the element and the scene, and can be opened from a disk.
 */
import { cpSync, existsSync, mkdirSync, readFileSync, statSync } from 'node:fs';
import { createRequire } from 'node:module';
import { basename, dirname, extname, join, relative, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { CommandError, parseCommandLine, runCommand, UsageError } from './lib/command.mjs';
import { filesBeside } from './lib/files-beside.mjs';
import { obstacleToFolder, writeWhole } from './lib/output-file.mjs';
import { serve } from './lib/server.mjs';

const USAGE = `usage: gaussian-splat page SCENE FOLDER [options]

  FOLDER        gets the element, the scene with the files that it names, and an index.html unless there is one
  --single      an index.html that contains the element and the scene, and can be opened from a disk
  --port N      port of the server that shows the page (default 8000, or a free one if it is taken)
  --no-serve    ends when the page is written
`;
const elementFile = (path) => fileURLToPath(new URL(path, import.meta.resolve('@gaussian-splat/element/package.json')));
const CDN = elementFile('cdn');
/** Module with the element and all of its late-loaded chunks. */
const ELEMENT = new URL('../dist/single.js', import.meta.url);
const SCRIPT = '<script type="module" src="cdn/gaussian-splat.min.js"></script>';

async function makePage({ scene, folder, port, isServed, isSingle }) {
  const page = join(folder, 'index.html');
  mkdirSync(folder, { recursive: true });
  if (isSingle) await writeSingle(scene, page);
  else await writeFolder(scene, folder, page);
  console.log(`\nThe page is ${isSingle ? page : `in ${folder}`}`);
  if (isServed) await show(folder, port);
}

async function writeFolder(scene, folder, page) {
  await copyElement(scene, join(folder, 'cdn'));
  const tag = tagOf(await copyScene(scene, folder), titleOf(scene));
  if (existsSync(page)) console.log(`\n${page} exists and was not changed. Paste into it:\n\n${SCRIPT}\n${tag}`);
  else writeWhole(page, htmlOf(SCRIPT, tag, titleOf(scene)));
}

/** Maximum bytes of a scene in a page of one file: its text must fit into a string of JavaScript. */
const MAX_SINGLE = 384e6;

/**
 * Writes an index.html that contains the element and the scene as text. The page converts the scene to a file with its
 * name, because the name identifies some formats.
 */
async function writeSingle(scene, page) {
  if (existsSync(page)) throw new CommandError(`${page} exists. With --single name a folder without an index.html.`);
  const { found, missing } = await filesBeside(scene);
  if (isJson(scene) || found.length + missing.length > 0 || isModel(scene))
    throw new CommandError(
      `${scene} consists of several files, or needs ONNX Runtime. --single takes a scene of one file: PLY, SPZ, SOG, .splat, .ksplat or GLB.`,
    );
  const { size } = statSync(scene);
  if (size > MAX_SINGLE)
    throw new CommandError(
      `${scene}: expected at most ${MAX_SINGLE / 1e6} MB for --single, found ${Math.ceil(size / 1e6)} MB. Make a page of several files, without --single.`,
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
  writeWhole(page, htmlOf(script, `<gaussian-splat alt="${title}" camera-controls></gaussian-splat>`, title));
}

function parseOptions(args) {
  const flag = { type: 'boolean', default: false };
  const options = { port: { type: 'string', default: '8000' }, 'no-serve': flag, single: flag };
  const parsed = parseCommandLine(args, options);
  if (parsed === undefined) return undefined;
  const { values, positionals } = parsed;
  if (positionals.length !== 2) throw new UsageError('A scene and a folder are needed');
  const [scene, folder] = positionals.map((path) => resolve(path));
  if (!existsSync(scene)) throw new UsageError(`There is no file ${scene}`);
  if (!statSync(scene).isFile()) throw new UsageError(`${scene} is a folder: name the scene's file in it`);
  if (existsSync(folder) && !statSync(folder).isDirectory())
    throw new UsageError(`${folder} is a file: a folder is needed`);
  const obstacle = obstacleToFolder(folder);
  if (obstacle) throw new UsageError(obstacle);
  const port = Number(values.port);
  if (!(Number.isInteger(port) && port >= 0 && port < 65536))
    throw new UsageError(`--port: expected a number from 0 to 65535, found "${values.port}"`);
  return { scene, folder, port, isServed: !values['no-serve'] && !values.single, isSingle: values.single };
}

/** Copies the element without source maps, and ONNX Runtime (43 MB) if the scene is a generator. */
async function copyElement(scene, target) {
  const isNeeded = (path) => {
    const inside = relative(CDN, path);
    return !inside.endsWith('.map') && (isModel(scene) || !inside.startsWith('onnxruntime'));
  };
  cpSync(CDN, target, { recursive: true, filter: isNeeded });
  if (!isModel(scene)) return;
  const { RUNTIME_FILES } = await import('@gaussian-splat/generator');
  // The published element does not contain the runtime, which is a dependency of the checker.
  const dist = dirname(createRequire(import.meta.resolve('@gaussian-splat/check')).resolve('onnxruntime-web'));
  for (const name of RUNTIME_FILES) {
    const file = join(target, 'onnxruntime', name);
    if (!existsSync(file)) cpSync(join(dist, name), file);
  }
}

/**
 * Copies the scene and the files that it refers to, and returns its path relative to the page. A scene of several files is
 * copied with its folder, because different scenes use the same file names.
 */
async function copyScene(scene, folder) {
  const [name, from] = [basename(scene), dirname(scene)];
  const { found, missing } = await filesBeside(scene);
  const isOfParts = isJson(scene) || (found.length > 0 && !isModel(scene));
  const own = isOfParts && from !== folder ? basename(from) : '';
  const to = join(folder, own);
  /** Why a file is not copied; undefined for one that is. */
  const refusal = (file) => {
    if (isCode(relative(folder, join(to, file)))) return 'a page or a script';
    return isModel(scene) || isPart(file) ? undefined : 'not a file of a scene';
  };
  const isRefused = (file) => refusal(file) !== undefined;
  missing.push(...found.filter(isRefused).map((file) => `${file} (${refusal(file)})`));
  if (missing.length > 0) console.warn(`${name} names files that were not copied: ${missing.join(', ')}`);
  const files = [name, ...found.filter((file) => !isRefused(file))];
  // Links are dereferenced, because their targets may be outside the folder.
  if (from !== to) for (const file of files) cpSync(join(from, file), join(to, file), { dereference: true });
  return own === '' ? name : `${own}/${name}`;
}

/**
 * Whether a file would run as code of the page's origin, or belongs to the page itself. Scenes are untrusted, so that none
 * may bring or replace such a file.
 */
function isCode(path) {
  return /(^|[\\/])[._][^\\/]*$|\.(s?x?html?|svgz?|xml|xslt?|[cm]?js|ph\w*|aspx?|jsp|cgi|pl|py|sh|config|htaccess|ini)[. ]*$|^cdn[\\/]/i.test(
    path,
  );
}

/** Whether a file may be a part of a scene. A list of what is allowed, because servers give meanings to many other names. */
function isPart(path) {
  return /\.(ply|spz|splat|ksplat|sog|json|bin|webp|png|jpe?g|ktx2|gltf|glb|rad|radc|lcc2?|subtree|motion|page|pages|gz)$/i.test(
    path,
  );
}

function isJson(path) {
  return extname(path).toLowerCase() === '.json';
}

/** Whether a scene is a generator; the element ignores case, too. */
const isModel = (path) => extname(path).toLowerCase() === '.onnx';

/** Returns the title of a page: the name of the scene's file, or of the folder of a JSON file. */
function titleOf(scene) {
  const file = isJson(scene) ? basename(dirname(scene)) : basename(scene, extname(scene));
  return file.replaceAll('&', '&amp;').replaceAll('"', '&quot;').replaceAll('<', '&lt;');
}

function tagOf(source, title) {
  const address = source.split('/').map(encodeURIComponent).join('/');
  return `<gaussian-splat src="${address}" alt="${title}" camera-controls></gaussian-splat>`;
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
  <script>
    // Browsers load modules by http only.
    const element = document.querySelector('gaussian-splat');
    if (location.protocol === 'file:' && element.hasAttribute('src'))
      element.textContent = 'This page needs a web server: run "npx http-server" in its folder, and open the address that it prints.';
  </script>
</html>
`;
}

/** Serves the page until the process is ended. */
async function show(folder, port) {
  const mounts = { '/': folder };
  const server = await serve(mounts, { port }).catch((error) => {
    if (error.code !== 'EADDRINUSE') throw error;
    return serve(mounts);
  });
  console.log(`and at http://localhost:${server.address().port}/ (Ctrl+C ends it)\n`);
  await new Promise((resolve) => server.once('close', resolve));
}

await runCommand(USAGE, parseOptions, makePage);
