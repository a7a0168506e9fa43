/** What a fresh clone lacks: Node packages and built files. */
import { existsSync, readdirSync, readFileSync, statSync, writeFileSync, mkdirSync } from 'node:fs';
import { createHash } from 'node:crypto';
import { join } from 'node:path';
import { must, root } from './run.mjs';

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

/** What the two builds are made from, and where they note that they are done. */
const WHOLE = { stamp: '.cache/built', sources: ['shaders', 'packages', 'demo', 'docs', 'scripts', 'package.json'] };
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
  if (!isBuilt({ ...WHOLE, sources: [...WHOLE.sources, ...AT_ROOT] })) build();
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

/** Notes that a build is done: `whole` holds the other two. */
export function noteBuilt(extent) {
  mkdirSync(join(root, '.cache'), { recursive: true });
  for (const { stamp } of STAMPS[extent]) writeFileSync(join(root, stamp), '');
}

function isBuilt({ stamp, sources }) {
  const path = join(root, stamp);
  const made = stamp === PACKAGES.stamp ? 'packages/three/dist/index.js' : 'packages/element/cdn/gaussian-splat.min.js';
  if (!existsSync(path) || !existsSync(join(root, made))) return false;
  return statSync(path).mtimeMs >= Math.max(...sources.map(newestChange));
}

/** Documents that the site shows. */
const AT_ROOT = ['README.md', 'CONTRIBUTING.md', 'CHANGELOG.md', 'SECURITY.md', 'LICENSE'];
const IGNORED = new Set(['node_modules', 'dist', 'cdn', 'generated']);

/** Latest modification time under a path, in milliseconds. */
function newestChange(path) {
  const absolute = join(root, path);
  const status = statSync(absolute);
  if (!status.isDirectory()) return status.mtimeMs;
  const children = readdirSync(absolute).filter((name) => !IGNORED.has(name) && !name.endsWith('.tsbuildinfo'));
  return Math.max(status.mtimeMs, ...children.map((name) => newestChange(join(path, name))));
}
