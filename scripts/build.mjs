/**
 * `npm run build`: shaders to typed constants, TypeScript to packages, the CDN bundle, the element's data for editors, and the demo as a static site.
 * `npm run build -- --element` ends with the CDN bundle: all that a separate page needs, in half of the time; `-- --packages` with the packages, which most tests of Node need; `-- --rest` is all that follows these. `-- --docs` adds the API reference of renderer, formats, generator and three to the site, in 20 seconds.
 */
import { copyFileSync, cpSync, existsSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { writeAttributeRows } from '../packages/element/scripts/attributes.mjs';
import { writeIntegrity } from '../packages/element/scripts/integrity.mjs';
import { beginBuild, ensureDependencies } from './lib/prepare.mjs';
import { must, mustSoon, root, TSC } from './lib/run.mjs';

/** Scripts of pages, each beside its page. */
const SCRIPTS = [
  'check/check.js',
  'check/run.js',
  'compare/compare.js',
  'docs/search.js',
  'examples/examples.js',
  'examples/features/features.js',
  'gallery/scene.js',
  'gallery/wall.js',
  'playground/playground.js',
  'three/three.js',
  'three-webgl/three-webgl.js',
];

/** Licences of ONNX Runtime and its dependencies, as its releases include them. */
const RUNTIME_LICENSES = 'packages/element/third-party/onnxruntime';

const extent = ['element', 'packages'].find((name) => process.argv.includes(`--${name}`)) ?? 'whole';

const noteBuilt = beginBuild(extent);
ensureDependencies();
if (!process.argv.includes('--rest')) await buildPackages();
if (extent !== 'packages') {
  const others = extent === 'whole' ? buildBesideBundle() : undefined;
  await bundleElement();
  await others;
  if (extent === 'whole') await buildApps();
  if (extent === 'whole') {
    writeApiReference();
    await buildPages();
  }
}
noteBuilt();

/** Shaders, languages and TypeScript. */
async function buildPackages() {
  const assembly = mustSoon(process.execPath, ['scripts/build-assembly.mjs']);
  must(process.execPath, ['scripts/build-shaders.mjs']);
  must(process.execPath, ['scripts/build-languages.mjs']);
  await assembly;
  must(process.execPath, [TSC, '--build', ...projects()]);
  for (const project of projects()) removeStaleOutputs(project);
  writeLicenses();
  await writeDecoders();
  if (extent !== 'element') await bundleThreads();
}

/** The CDN bundle, which takes longest. */
async function bundleElement() {
  const bundle = (script, config, part) =>
    mustSoon(process.execPath, [
      `node_modules/${script}`,
      ...['--config', `packages/element/${config}.config.mjs`, '--environment', `PART:${part}`],
      ...(config === 'rollup' ? ['--silent'] : []),
    ]);
  const [rollup, rolldown] = ['rollup/dist/bin/rollup', 'rolldown/bin/cli.mjs'];
  await bundle(rolldown, 'rolldown', 'three');
  await Promise.all([bundle(rollup, 'rollup', 'page'), bundle(rollup, 'rollup', 'worker')]);
  await bundle(rolldown, 'rolldown', 'single');
  writeLicensesOfBundle();
  console.log(`integrity of gaussian-splat.min.js: ${writeIntegrity()['gaussian-splat.min.js']}`);
}

/** The decoders of compressed meshes and textures. esbuild was not there when this script started on a fresh clone. */
async function writeDecoders() {
  const decoders = await import('../packages/formats/scripts/decoders.mjs');
  await decoders.writeDecoders();
}

/** The script of threads that commands start. */
async function bundleThreads() {
  const { bundleThreadScript } = await import('../packages/cli/src/lib/thread-pool.mjs');
  await bundleThreadScript();
}

/** All that needs the packages, but not the bundle. */
async function buildBesideBundle() {
  await describeElement();
  await buildDemo();
}

/** The element's project refers to those of the packages that it is made of. */
function projects() {
  const names =
    extent !== 'element'
      ? ['core', 'formats', 'renderer', 'generator', 'check', 'optimize', 'element', 'react', 'three']
      : ['element'];
  return names.map((name) => `packages/${name}`);
}

/** Removes modules whose source is no longer there. tsc keeps them; an import of one then fails on a fresh clone alone, and npm publishes them. */
function removeStaleOutputs(project) {
  const from = join(root, project, 'src');
  const to = join(root, project, 'dist');
  const declarations = readdirSync(to, { recursive: true }).filter((name) => name.endsWith('.d.ts'));
  for (const name of declarations.map((file) => file.slice(0, -'.d.ts'.length))) {
    if (['.ts', '.tsx', '.d.ts'].some((extension) => existsSync(join(from, name + extension)))) continue;
    for (const extension of ['.js', '.js.map', '.d.ts', '.d.ts.map'])
      rmSync(join(to, name + extension), { force: true });
  }
}

/** npm takes a licence from the package's own folder only. */
function writeLicenses() {
  for (const name of readdirSync(join(root, 'packages'))) {
    const folder = join(root, 'packages', name);
    if (existsSync(join(folder, 'package.json'))) copyFileSync(join(root, 'LICENSE'), join(folder, 'LICENSE'));
  }
}

/** The bundle has no comments, and the licences of its dependencies require their text. */
function writeLicensesOfBundle() {
  const own = readFileSync(join(root, 'LICENSE'), 'utf8');
  const textOf = ([what, file]) => `${what}\n\n${readFileSync(join(root, file), 'utf8')}`;
  const others = [
    ['Lit (lit-html, lit-element, @lit/reactive-element), in gaussian-splat.min.js', 'node_modules/lit/LICENSE'],
    ['fflate, in readers/', 'node_modules/fflate/LICENSE'],
    ['three.js, in the script that is fetched for meshes', 'node_modules/three/LICENSE'],
    ['meshoptimizer, in readers/', 'packages/formats/third-party/meshoptimizer/LICENSE'],
    ['Draco, in the script that is fetched for meshes with Draco', 'packages/formats/third-party/draco/LICENSE'],
    [
      'Basis Universal, in the script that is fetched for KTX2 textures',
      'packages/formats/third-party/basis-universal/LICENSE',
    ],
  ].map(textOf);
  // Its npm package has neither.
  const runtime = [
    ['ONNX Runtime', `${RUNTIME_LICENSES}/LICENSE`],
    ['What ONNX Runtime is made of', `${RUNTIME_LICENSES}/ThirdPartyNotices.txt`],
  ].map(textOf);
  const cdn = join(root, 'packages/element/cdn');
  writeFileSync(join(cdn, 'LICENSES.txt'), [`gaussian-splat\n\n${own}`, ...others].join('\n\n'));
  writeFileSync(join(cdn, 'onnxruntime/LICENSES.txt'), runtime.join('\n\n'));
}

/** Writes the element's data for editors and tools, from its sources. */
async function describeElement() {
  const analyzer = join(root, 'node_modules/@custom-elements-manifest/analyzer/cem.js');
  const config = 'custom-elements-manifest.config.mjs';
  const cwd = join(root, 'packages/element');
  await mustSoon(process.execPath, [analyzer, 'analyze', '--quiet', '--config', config], { cwd });
  writeAttributeRows(JSON.parse(readFileSync(join(cwd, 'custom-elements.json'), 'utf8')));
}

/** Scripts and scenes of the site, but its pages. */
async function buildDemo() {
  const from = join(root, 'demo');
  const to = join(root, 'demo/dist');
  rmSync(to, { recursive: true, force: true });
  const { writeSequence } = await import('../demo/site/sequence-scene.mjs');
  await writeSequence(join(to, 'scenes/knot'));
  const { writeClip } = await import('../demo/site/clip-scene.mjs');
  await writeClip(join(to, 'scenes'));
  const { writePavilion } = await import('../demo/site/pavilion.mjs');
  writePavilion(join(to, 'scenes/pavilion.glb'));
  // Its packages were not there when this script started on a fresh clone.
  const { bundleBench } = await import('./lib/bundle-bench.mjs');
  await bundleBench(join(to, 'bench'));
  const { build } = await import('esbuild');
  // The map starts its workers from this file.
  for (const name of ['maplibre-gl-worker.mjs', 'maplibre-gl.css'])
    cpSync(join(root, 'node_modules/maplibre-gl/dist', name), join(to, 'map', name));
  const options = { outdir: to, outbase: from, bundle: true, format: 'esm', minify: true, logLevel: 'warning' };
  // Code that a page loads later is a separate script.
  await build({ ...options, entryPoints: SCRIPTS.map((name) => join(from, name)), external: ['./run.js'] });
  for (const [name, folder] of [
    ['home.js', 'home'],
    ['map/map.js', 'map'],
  ])
    await build({
      ...options,
      entryPoints: [join(from, name)],
      splitting: true,
      chunkNames: `${folder}/[name]-[hash]`,
    });
}

/** Vite builds the apps from the bundle's production output. */
async function buildApps() {
  const from = join(root, 'demo');
  const buildApp = (app) => {
    const config = join(from, app, 'vite.config.mjs');
    return mustSoon(process.execPath, [
      'node_modules/vite/bin/vite.js',
      ...['build', '--config', config, '--logLevel', 'warn'],
    ]);
  };
  await Promise.all(['react', 'vue'].map(buildApp));
}

/** The site links to the reference if the build made it. Other builds remove it, so that it is never outdated. */
function writeApiReference() {
  rmSync(join(root, 'demo/dist/api'), { recursive: true, force: true });
  if (process.argv.includes('--docs')) must(process.execPath, ['node_modules/typedoc/bin/typedoc']);
}

/** demo/dist is the whole site: any static host can serve it. Eleventy copies the bundle, and names its digests. */
function buildPages() {
  return mustSoon(process.execPath, [
    'node_modules/@11ty/eleventy/cmd.cjs',
    '--quiet',
    '--config=demo/site/eleventy.config.mjs',
  ]);
}
