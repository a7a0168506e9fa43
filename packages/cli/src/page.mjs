/**
 * Implementation of `gaussian-splat page SCENE... FOLDER [--single] [--usdz] [--port 8000] [--no-serve]`. Reads the
 * scenes, copies the element and them to FOLDER, writes an index.html unless one exists, and serves the folder. Any static
 * host can serve the result. With `--single`, the index.html contains the element and the scene, and can be opened from a
 * disk.
 */
import { cpSync, existsSync, mkdirSync, readFileSync, statSync } from 'node:fs';
import { createRequire } from 'node:module';
import { basename, dirname, extname, join, relative, resolve } from 'node:path';
import { addressOf, CDN, copyElement, escaped, writeCatalogue } from './lib/catalogue.mjs';
import {
  CommandError,
  isCollection,
  parseCommandLine,
  report,
  runCommand,
  sayWarnings,
  SeveralInputs,
  UsageError,
} from './lib/command.mjs';
import { CREDIT_OPTIONS, CREDIT_USAGE, credited } from './lib/credits.mjs';
import { filesBeside } from './lib/files-beside.mjs';
import { obstacleToFolder, writeWhole } from './lib/output-file.mjs';
import { serve } from './lib/server.mjs';
import { shownAs } from './lib/shown-as.mjs';

/** Number of splats that phones draw, by reports. */
const MAX_USDZ = 200_000;

const USAGE = `usage: gaussian-splat page SCENE... FOLDER [options]

  SCENE         scene, clip, generator or mesh; several are shown one below the other
  FOLDER        gets the element, the scenes with the files that they name, and an index.html unless there is one
  --single      an index.html that contains the element and the scene, and can be opened from a disk
  --usdz        also writes at most ${MAX_USDZ} splats as OpenUSD (.usdz) beside the page, which links them for AR on iPhones
  --port N      port of the server that shows the page (default 8000, or a free one if it is taken)
  --no-serve    ends when the page is written
  --catalogue   lists the scenes, and shows one at a time; the default for a folder or a pattern
  --scene-only  reads and copies the scenes, without the element and a page
${CREDIT_USAGE.replace('SCENE', 'the scenes')}
`;
/** Module with the element and all of its late-loaded chunks. */
const ELEMENT = new URL('../dist/single.js', import.meta.url);
const SCRIPT = '<script type="module" src="cdn/gaussian-splat.min.js"></script>';

async function makePage({ scenes, folder, port, isServed, isSingle, isSceneOnly, hasUsdz, credits }) {
  const page = join(folder, 'index.html');
  const shown = [];
  for (const scene of scenes) shown.push(await shownAs(scene));
  mkdirSync(folder, { recursive: true });
  if (isSceneOnly)
    for (const [k, scene] of scenes.entries()) report({ source: await copyScene(scene, folder), ...shown[k] });
  else if (isSingle) await writeSingle(scenes[0], shown[0], page, attributesOf(scenes[0], { credits, hasUsdz }));
  else await writeFolder(scenes, shown, folder, page, { credits, hasUsdz });
  for (const scene of hasUsdz ? scenes : []) await writeUsdz(scene, folder, credits);
  if (!isSceneOnly) console.log(`\nThe page is ${isSingle ? page : `in ${folder}`}`);
  if (isServed) await show(folder, port);
}

async function writeFolder(scenes, shown, folder, page, options) {
  copyElement(join(folder, 'cdn'), scenes.some(isModel));
  if (scenes.some(isModel)) await copyRuntime(join(folder, 'cdn/onnxruntime'));
  const elements = [];
  for (const [i, scene] of scenes.entries()) {
    const source = await copyScene(scene, folder);
    const own = attributesOf(scene, options);
    elements.push((style) => elementOf(shown[i], titleOf(scene), ` src="${addressOf(source)}"`, own + style));
  }
  const markup = (style) => elements.map((element) => element(style)).join('\n  ');
  const size = ' style="display: block; width: 100%; height: 80vh"';
  if (existsSync(page))
    console.log(`\n${page} exists and was not changed. Paste into it:\n\n${SCRIPT}\n${markup(size)}`);
  else writeWhole(page, htmlOf(`${markup('')}\n  ${SCRIPT}\n${FROM_DISK}`, titleOf(scenes[0])));
}

/** Writes the splats of a scene as OpenUSD, fewer if there are too many for phones. */
async function writeUsdz(scene, folder, credits) {
  const [{ startReading }, { changeFormat, lossesIn }, { fewerSplats }, { inline }] = await Promise.all([
    import('./lib/scene-in-parts.mjs'),
    import('@gaussian-splat/optimize'),
    import('@gaussian-splat/optimize/pages'),
    import('@gaussian-splat/optimize/parts'),
  ]);
  const out = join(folder, usdzOf(scene));
  const whole = credited(await (await startReading(scene, inline)).cloud, credits);
  const losses = whole.antialiased ? ['Its filter is left out of the USDZ, so it looks fuller from afar in AR.'] : [];
  sayWarnings(scene, whole, [...lossesIn(out, whole), ...losses]);
  const cloud = { ...fewerSplats(whole, MAX_USDZ), antialiased: false, filterVariance: undefined };
  writeWhole(out, (await changeFormat(cloud, { name: out })).bytes);
  console.log(`\n${out}: ${cloud.count} of ${whole.count} splats as OpenUSD`);
}

/** Maximum bytes of a scene in a page of one file: its text must fit into a string of JavaScript. */
const MAX_SINGLE = 384e6;

/**
 * Writes an index.html that contains the element and the scene as text. The page converts the scene to a file with its
 * name, because the name identifies some formats.
 */
async function writeSingle(scene, shown, page, attributes) {
  if (existsSync(page)) throw new CommandError(`${page} exists. With --single name a folder without an index.html.`);
  const { found, missing } = await filesBeside(scene);
  if (isJson(scene) || found.length + missing.length > 0 || isModel(scene))
    throw new CommandError(
      `${scene} consists of several files, or needs ONNX Runtime. --single takes a scene of one file: PLY, SPZ, SOG, .splat, .ksplat, GLB or USDZ.`,
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
    await customElements.whenDefined('${shown.tag}');
    document.querySelector('${shown.tag}').src = new File([await data.blob()], ${name});
  </script>`;
  writeWhole(page, htmlOf(`${elementOf(shown, title, '', attributes)}\n  ${script}`, title));
}

function parseOptions(args) {
  const flag = { type: 'boolean', default: false };
  const options = { port: { type: 'string', default: '8000' }, 'no-serve': flag, single: flag, usdz: flag };
  Object.assign(options, { catalogue: flag, 'scene-only': flag, ...CREDIT_OPTIONS });
  const parsed = parseCommandLine(args, options);
  if (parsed === undefined) return undefined;
  const { values, positionals } = parsed;
  if (positionals.length < 2) throw new UsageError('A scene and a folder are needed');
  const inputs = positionals.slice(0, -1);
  if (values.catalogue || inputs.some(isCollection))
    throw new SeveralInputs(inputs, { ...values, out: positionals.at(-1) }, options);
  const paths = positionals.map((path) => resolve(path));
  const [folder, scenes] = [paths.pop(), paths];
  for (const scene of scenes) {
    if (!existsSync(scene)) throw new UsageError(`There is no file ${scene}`);
  }
  // Scenes of several files are copied with their folders.
  const nameOf = (scene) => (/\.(json|gltf)$/i.test(scene) ? basename(dirname(scene)) : '') + basename(scene);
  const twin = scenes.find((scene, i) => scenes.findIndex((other) => nameOf(other) === nameOf(scene)) !== i);
  if (twin) throw new UsageError(`There are two files ${basename(twin)}: rename one`);
  for (const [k, scene] of values.usdz ? scenes.entries() : []) {
    if (isModel(scene)) throw new UsageError(`${scene} is a generator: --usdz takes a scene file`);
    if (scenes.findIndex((other) => usdzOf(other) === usdzOf(scene)) < k)
      throw new UsageError(`--usdz: there are two scenes for ${usdzOf(scene)}: rename one`);
  }
  if (values.single && scenes.length > 1) throw new UsageError('--single takes one scene');
  if (existsSync(folder) && !statSync(folder).isDirectory())
    throw new UsageError(`${folder} is a file: a folder is needed`);
  const obstacle = obstacleToFolder(folder);
  if (obstacle) throw new UsageError(obstacle);
  const port = Number(values.port);
  if (!(Number.isInteger(port) && port >= 0 && port < 65536))
    throw new UsageError(`--port: expected a number from 0 to 65535, found "${values.port}"`);
  return {
    scenes,
    folder,
    port,
    isServed: !values['no-serve'] && !values.single && !values['scene-only'],
    isSceneOnly: values['scene-only'],
    isSingle: values.single,
    hasUsdz: values.usdz,
    credits: { attribution: values.attribution, license: values.license },
  };
}

/** Copies ONNX Runtime, which the published element does not contain: it is a dependency of the checker. */
async function copyRuntime(target) {
  const { RUNTIME_FILES } = await import('@gaussian-splat/generator');
  const dist = dirname(createRequire(import.meta.resolve('@gaussian-splat/check')).resolve('onnxruntime-web'));
  for (const name of RUNTIME_FILES) if (!existsSync(join(target, name))) cpSync(join(dist, name), join(target, name));
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
  return /\.(ply|spz|splat|ksplat|sog|json|bin|webp|png|jpe?g|ktx2|gltf|glb|rad|radc|lcc2?|usd[acz]?|subtree|motion|page|pages|gz)$/i.test(
    path,
  );
}

function isJson(path) {
  return extname(path).toLowerCase() === '.json';
}

/** Whether a scene is a generator; the element ignores case, too. */
const isModel = (path) => extname(path).toLowerCase() === '.onnx';

/** Returns the name of a scene's file without its extension, or that of the folder of a JSON file. */
const plainTitleOf = (scene) => (isJson(scene) ? basename(dirname(scene)) : basename(scene, extname(scene)));

/** Returns the title of a page: the name of the scene's file, or of the folder of a JSON file. */
function titleOf(scene) {
  return escaped(plainTitleOf(scene));
}

/** Returns the name of the file of {@link writeUsdz}. */
const usdzOf = (scene) => `${plainTitleOf(scene)}-ar.usdz`;

/** Returns the attributes of credits, and of AR. */
const attributesOf = (scene, { credits: { attribution, license }, hasUsdz }) =>
  Object.entries({ attribution, license, ...(hasUsdz && { 'ios-splats': addressOf(usdzOf(scene)) }) })
    .map(([name, text]) => (text === undefined ? '' : ` ${name}="${escaped(text)}"`))
    .join('') + (hasUsdz ? ' ar' : '');

/** Returns the HTML that shows a scene, or a mesh, which is a child of the element. */
function elementOf({ tag, attributes: flags }, title, src = '', attributes = '') {
  const [own, child] = tag === 'splat-mesh' ? ['', `\n    <splat-mesh${src}></splat-mesh>\n  `] : [src, ''];
  return `<gaussian-splat${own} alt="${title}" ${['camera-controls', ...flags].join(' ')}${attributes}>${child}</gaussian-splat>`;
}

/** Browsers load modules by http only, so that the page of a folder stays empty when it is opened from a disk. */
const FROM_DISK = `  <script>
    if (location.protocol === 'file:')
      for (const element of document.querySelectorAll('gaussian-splat'))
        element.textContent = 'This page needs a web server: run "npx http-server" in its folder, and open the address that it prints.';
  </script>`;

function htmlOf(body, title) {
  return `<!doctype html>
<html lang="en">
  <meta charset="utf-8" />
  <meta name="viewport" content="width=device-width, initial-scale=1" />
  <title>${title}</title>
  <style>
    gaussian-splat { display: block; width: 100%; height: 80vh; background: #ddd; }
  </style>
  ${body}
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

/** Writes the page of a batch, with ONNX Runtime if a scene needs it. */
async function finishCatalogue(folder, rows) {
  const listed = rows.map((row) => ({ ...row, src: row.error ? undefined : `${row.out}/${row.source}` }));
  writeCatalogue(folder, listed);
  if (listed.some(({ src }) => src && isModel(src))) await copyRuntime(join(folder, 'cdn/onnxruntime'));
}

await runCommand(USAGE, parseOptions, makePage, {
  name: 'page',
  endings: [''],
  single: ['single'],
  own: ['catalogue', 'no-serve', 'port'],
  accepts: (path, isScene) => isScene(path) || /\.(onnx|gsv|4dgs)$/i.test(path),
  argumentsFor: (scene, out) => [scene, out, '--scene-only'],
  finish: finishCatalogue,
  afterwards: (folder, values) => (values['no-serve'] ? undefined : show(folder, Number(values.port ?? 8000))),
});
