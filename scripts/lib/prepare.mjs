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
  must(process.platform === 'win32' ? 'npm.cmd' : 'npm', ['ci', '--no-audit', '--no-fund']);
  writeFileSync(stamp, lock);
}

/** Builds everything unless nothing changed since the last build. */
export function ensureBuilt() {
  const stamp = join(root, '.cache/built');
  const newest = Math.max(
    ...['shaders', 'packages', 'demo', 'docs', 'scripts', 'package.json', ...AT_ROOT].map(newestChange),
  );
  if (existsSync(stamp) && statSync(stamp).mtimeMs >= newest && existsSync(join(root, 'packages/element/dist'))) return;
  build();
  mkdirSync(join(root, '.cache'), { recursive: true });
  writeFileSync(stamp, '');
}

/** Builds shaders, packages, bundles and the demo. */
export function build() {
  must(process.execPath, ['scripts/build.mjs']);
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
