/**
 * `npm run test:apps [-- NAME… [--newest]]`: the apps of tests/apps, each as a user would make it, with the versions that the list names or, with `--newest`, the latest ones. Installs our packages from the files of the release, builds, opens the
 * app in Chromium, and starts the development server if the list has one. Each has to be built without a warning, and to show its scene and a generator, with a worker and a clean console; the bytes of code until the scene is visible, and after it, are printed. Apps stay in .cache/apps, so that a second run installs our packages alone.
 */
import { spawn, spawnSync } from 'node:child_process';
import { cpSync, existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { extname, join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { parseArgs } from 'node:util';
import { APPS } from '../tests/apps/apps.mjs';
import { visitApp } from '../tests/apps/visit.mjs';
import { ensureChromium } from './lib/chromium.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { root } from './lib/run.mjs';

const CACHE = join(root, '.cache/apps');
const SCENE = join(root, 'demo/scenes/skull.spz');
/** Finds a build that hangs: a machine at a load of 20 needs more than 400 s for webpack. */
const BUILD_SECONDS = 1200;
/** `--newest` leaves Node, and versions that other packages of the app pin. */
const NOT_NEWEST = new Set(['node', 'typescript', 'rxjs']);
/** A line of a build's output that warns, with the lines below it. */
const WARNING = /.*\bwarn(ing|ings)?\b(.*\n?){0,12}/i;
/** Advice about the sizes of chunks that pages fetch late, such as three.js for meshes, what Nuxt 4.4 and Astro 6.0 say of modules of their own, and warnings without words. */
const ADVICE = [
  /\(!\) Some chunks are larger than 500 kB[^]*?chunkSizeWarningLimit\.?/g,
  /WARNING in (⚠ )?(asset size limit|entrypoint size limit|webpack performance recommendations)[^]*?(?=\n\n|$)/g,
  /compiled with \d+ warnings?/g,
  /WARN +\[plugin nuxt:module-preload-polyfill\] Sourcemap is likely to be incorrect.*/g,
  /\[WARN\] \[vite\] *("[^\n]*imported from external module "@astrojs\/[^\n]*)?$/gm,
  /^ *WARN *$/gm,
];
/** Messages of Lit and the tools in development mode. */
const DEVELOPMENT = /Lit is in dev mode|\[vite\]|Download the React DevTools/;

const { values: options, positionals: asked } = parseArgs({
  allowPositionals: true,
  options: { install: { type: 'boolean' }, newest: { type: 'boolean' } },
});
const names = asked.length > 0 ? asked : Object.keys(APPS);
const unknown = names.filter((name) => !Object.hasOwn(APPS, name));
if (unknown.length > 0) {
  console.error(`${unknown.join(', ')}: expected one of ${Object.keys(APPS).join(', ')}.`);
  process.exit(2);
}

ensureDependencies();
ensureBuilt();
process.env.CHROMIUM = ensureChromium();
const { packPackages, withOwn } = await import('./lib/release.mjs');
rmSync(join(CACHE, 'packed'), { recursive: true, force: true });
const tarballs = packPackages(join(CACHE, 'packed'));
let failures = 0;
for (const name of names) {
  try {
    await tryApp(name, APPS[name]);
  } catch (error) {
    failures++;
    console.log(`${name}: FAILED\n${error.message}\n`);
  }
}
console.log(`${names.length - failures} of ${names.length} apps are as they should be`);
process.exit(failures > 0 ? 1 : 0);

async function tryApp(name, app) {
  const folder = join(CACHE, name);
  await install(folder, name, app);
  console.log(`${name}: ${versionsIn(folder, app)}`);
  if (options.install) return;
  const complaint = WARNING.exec(
    ADVICE.reduce((text, advice) => text.replaceAll(advice, ''), command(app.build, folder)),
  );
  if (complaint) throw new Error(`the build warns: ${complaint[0]}`);
  if (!app.output) return console.log(`${name}: passes`);
  const output = join(folder, app.output);
  const place = extname(output) === '.html' ? { address: pathToFileURL(output).href } : { folder: output };
  const { faults, hasGenerator = extname(output) !== '.html' } = app;
  print(name, await visitApp({ ...place, elsewhere: join(folder, 'elsewhere'), faults, hasGenerator }), app);
  if (!app.dev) return;
  const port = await freePort();
  const [program, ...args] = app.dev.map((word) => (word === 'PORT' ? String(port) : word));
  const server = spawn(program, args, { cwd: folder, env: environment(), stdio: 'ignore', detached: true });
  try {
    print(`${name}, development`, await visitApp({ address: `http://localhost:${port}/`, faults: DEVELOPMENT }), {});
  } finally {
    process.kill(-server.pid, 'SIGKILL');
  }
}

function print(name, { code, workers, painted, generated }, { most: max = Infinity }) {
  const percent = (share) => `${(share * 100).toFixed(0)} %`;
  const also = generated === undefined ? '' : ` and ${percent(generated)} by a generator`;
  const { first, late, scripts } = code;
  const bytes = `${first} bytes of gzip until the scene is visible and ${late} later`;
  const sent = scripts.length > 0 ? `, ${bytes}, in ${scripts.length} scripts` : '';
  console.log(`${name}: ${percent(painted)} painted${also}, ${workers} worker(s)${sent}`);
  if (first + late <= max) return;
  const list = scripts.map(({ name, gzip, isLate }) => `\n${gzip} ${name}${isLate ? ' (later)' : ''}`).join('');
  throw new Error(`expected at most ${max} bytes, found ${first + late}:${list}`);
}

/** The app's files and its packages. Packages of others stay from one run to the next, except with `--newest`: npm would keep the versions that it finds. */
async function install(folder, name, { folder: template = name, dependencies }) {
  mkdirSync(folder, { recursive: true });
  for (const file of readdirSync(folder)) {
    if (options.newest || file !== 'node_modules') rmSync(join(folder, file), { recursive: true });
  }
  const files = join(root, 'tests/apps', template);
  if (existsSync(files)) cpSync(files, folder, { recursive: true });
  // Apps have their static files in different folders.
  for (const place of ['.', 'public', 'static', 'dist']) {
    mkdirSync(join(folder, place), { recursive: true });
    cpSync(SCENE, join(folder, place, 'scene.spz'));
  }
  const entries = Object.entries(dependencies).flatMap(([each, wanted]) =>
    wanted === 'release'
      ? withOwn(each).map((name) => [name, `file:${tarballs.get(name)}`])
      : [[each, options.newest && !NOT_NEWEST.has(each) ? 'latest' : wanted]],
  );
  const manifest = { name: 'app', private: true, type: 'module', dependencies: Object.fromEntries(entries) };
  writeFileSync(join(folder, 'package.json'), JSON.stringify(manifest, null, 2));
  rmSync(join(folder, 'node_modules/@gaussian-splat'), { recursive: true, force: true });
  // It has the digests of our packages of the last time.
  rmSync(join(folder, 'node_modules/.package-lock.json'), { force: true });
  await soon(
    [
      'npm',
      'install',
      '--no-audit',
      '--no-fund',
      '--loglevel=error',
      options.newest ? '--prefer-online' : '--prefer-offline',
    ],
    folder,
  );
}

/** The packages of an app, with the versions that were installed. */
function versionsIn(folder, { dependencies }) {
  const versionOf = (each) =>
    JSON.parse(readFileSync(join(folder, 'node_modules', each, 'package.json'), 'utf8')).version;
  return Object.keys(dependencies)
    .filter((each) => dependencies[each] !== 'release')
    .map((each) => `${each} ${versionOf(each)}`)
    .join(', ');
}

async function soon([program, ...args], cwd) {
  const child = spawn(program, args, { cwd, env: environment() });
  let output = '';
  for (const stream of [child.stdout, child.stderr]) stream.on('data', (data) => (output += data));
  const status = await new Promise((resolve, reject) => child.on('error', reject).on('close', resolve));
  if (status !== 0) throw new Error(`${program} ${args.join(' ')}: status ${status}\n${output.slice(-4000)}`);
}

function command([program, ...args], cwd) {
  const options = { cwd, env: environment(), encoding: 'utf8', timeout: BUILD_SECONDS * 1000, maxBuffer: 1 << 26 };
  const words = args.map((word) => word.replace('ROOT/', root));
  const { status, stdout, stderr } = spawnSync(program, words, options);
  if (status !== 0)
    throw new Error(`${program} ${args.join(' ')}: status ${status}\n${(stdout + stderr).slice(-4000)}`);
  return stdout + stderr;
}

function environment() {
  // Both come from the environment of this command: builds of users have neither.
  const { NODE_ENV, INIT_CWD, ...inherited } = process.env;
  void [NODE_ENV, INIT_CWD];
  return { ...inherited, NEXT_TELEMETRY_DISABLED: '1', ASTRO_TELEMETRY_DISABLED: '1', NG_CLI_ANALYTICS: 'false' };
}

function freePort() {
  return new Promise((resolve) => {
    const server = createServer().listen(0, '127.0.0.1', () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });
}
