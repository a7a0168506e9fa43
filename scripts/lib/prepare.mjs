/** Installs and builds the parts that a fresh clone lacks: Node packages and built files. */
import { existsSync, readdirSync, readFileSync, statSync, writeFileSync, mkdirSync } from 'node:fs';
import { createHash } from 'node:crypto';
import { join } from 'node:path';
import { must, mustSoon, root } from './run.mjs';

/** Installs the Node packages if the lock file changed since the last installation, or nothing is installed. */
export function ensureDependencies() {
  const lock = createHash('sha256')
    .update(readFileSync(join(root, 'package-lock.json')))
    .digest('hex');
  const stamp = join(root, 'node_modules/.installed-lock');
  if (existsSync(stamp) && readFileSync(stamp, 'utf8') === lock) return;
  console.log('Installing Node packages.');
  must(process.platform === 'win32' ? 'npm.cmd' : 'npm', ['ci', '--no-audit', '--no-fund', '--loglevel=error']);
  writeFileSync(stamp, lock);
}

/** Inputs of the two builds, and the files that record a finished build. */
const WHOLE = {
  stamp: '.cache/built',
  sources: [
    ...['shaders', 'packages', 'demo', 'benchmarks', 'docs', 'scripts', 'package.json'],
    // Documents that the site shows.
    ...['README.md', 'CONTRIBUTING.md', 'CHANGELOG.md', 'SECURITY.md', 'LICENSE'],
  ],
};
const ELEMENT = {
  stamp: '.cache/built-element',
  sources: ['shaders', 'packages', 'scripts/build.mjs', 'package.json'],
};

/** The TypeScript of the packages alone: all that most tests of Node need. */
const PACKAGES = {
  stamp: '.cache/built-packages',
  sources: ['shaders', 'packages', 'scripts', 'package.json', 'tsconfig.base.json'],
};

/** Builds everything unless nothing changed since the last build. */
export function ensureBuilt() {
  if (!isBuilt(WHOLE)) build();
}

/** The same in two steps: the packages are built when this returns, bundles and site when its promise resolves. */
export async function ensureBuiltSoon() {
  if (isBuilt(WHOLE)) return;
  ensurePackages();
  await mustSoon(process.execPath, ['scripts/build.mjs', '--rest']);
}

/** Builds the element alone, which takes half of the time, unless nothing changed since it was built. */
export function ensureElement() {
  if (!isBuilt(ELEMENT)) must(process.execPath, ['scripts/build.mjs', '--element']);
}

/** Builds the packages, without bundles and site, unless nothing changed since they were built. */
export function ensurePackages() {
  if (!isBuilt(PACKAGES)) must(process.execPath, ['scripts/build.mjs', '--packages']);
}

/** Builds shaders, packages, bundles and the demo. */
export function build() {
  must(process.execPath, ['scripts/build.mjs']);
}

const STAMPS = { whole: [PACKAGES, WHOLE, ELEMENT], element: [ELEMENT], packages: [PACKAGES] };

/** Starts a build. The function returned records that it is done (`whole` includes the other two) with the sources at its start, so that later edits cause another build. */
export function beginBuild(extent) {
  const before = STAMPS[extent].map(({ stamp, sources }) => [join(root, stamp), fingerprint(sources)]);
  return () => {
    mkdirSync(join(root, '.cache'), { recursive: true });
    for (const [path, state] of before) writeFileSync(path, state);
  };
}

function isBuilt({ stamp, sources }) {
  const path = join(root, stamp);
  const made = stamp === PACKAGES.stamp ? 'packages/three/dist/index.js' : 'packages/element/cdn/gaussian-splat.min.js';
  return existsSync(path) && existsSync(join(root, made)) && readFileSync(path, 'utf8') === fingerprint(sources);
}

/** Outputs of builds among the sources. */
const IGNORED = new Set([
  ...['node_modules', 'dist', 'cdn', 'generated', 'LICENSE'],
  ...['custom-elements.json', 'vscode.html-custom-data.json', 'web-types.json'],
]);

/** Digest of all files under some paths, with the times of their last changes. */
function fingerprint(paths) {
  return createHash('sha256').update(paths.flatMap(changesUnder).join('\n')).digest('hex');
}

function changesUnder(path) {
  const status = statSync(join(root, path));
  if (!status.isDirectory()) return [`${path} ${status.mtimeMs}`];
  const children = readdirSync(join(root, path)).filter((name) => !IGNORED.has(name) && !name.endsWith('.tsbuildinfo'));
  return children.flatMap((name) => changesUnder(`${path}/${name}`));
}
