/** Packages that a change affects: the packages of the files that git finds different, and all that depend on them. */
import { execFileSync } from 'node:child_process';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from './run.mjs';
import { TESTS_OF } from './test-files.mjs';

/** Packages that changed since a commit, by default the one at which this branch left `main`; uncommitted changes count. */
export function changedPackages(since = branchPoint()) {
  const files = [git('diff', '--name-only', since), git('ls-files', '--others', '--exclude-standard')]
    .join('\n')
    .split('\n')
    .filter(Boolean);
  return { files, packages: [...new Set(files.flatMap(packagesOf))] };
}

/** Packages, and all that depend on them. */
export function withDependants(packages) {
  const needs = dependencies();
  const found = new Set(packages);
  for (const name of found) {
    for (const [other, needed] of Object.entries(needs)) if (needed.has(name)) found.add(other);
  }
  return [...found];
}

/** The packages that a file belongs to; a tool or a setting of the whole project belongs to all. */
function packagesOf(file) {
  const all = Object.keys(TESTS_OF);
  const [top, second] = file.split('/');
  if (top === 'packages') return [second];
  if (top === 'shaders') return ['renderer', 'optimize'];
  if (top === 'tests' && second !== 'support' && second !== 'fixtures')
    return all.filter((name) => TESTS_OF[name].includes(second));
  if (top === 'demo' || top === 'benchmarks' || top === 'docs' || file.endsWith('.md')) return ['site'];
  if (top === 'scripts' || top === 'exporter') return [];
  return all;
}

/** Packages of this project that each package names as dependencies. */
function dependencies() {
  const names = readdirSync(join(root, 'packages')).filter((name) => existsSync(manifestOf(name)));
  const manifests = Object.fromEntries(names.map((name) => [name, JSON.parse(readFileSync(manifestOf(name), 'utf8'))]));
  const folderOf = Object.fromEntries(names.map((name) => [manifests[name].name, name]));
  const known = names.map((name) => {
    const { dependencies = {}, peerDependencies = {}, optionalDependencies = {} } = manifests[name];
    const needed = Object.keys({ ...dependencies, ...peerDependencies, ...optionalDependencies });
    return [name, new Set(needed.map((other) => folderOf[other]).filter(Boolean))];
  });
  return { ...Object.fromEntries(known), site: new Set(['element']) };
}

function manifestOf(name) {
  return join(root, 'packages', name, 'package.json');
}

function branchPoint() {
  for (const branch of ['origin/main', 'main']) {
    try {
      return git('merge-base', 'HEAD', branch).trim();
    } catch {
      // A clone without that branch.
    }
  }
  return 'HEAD';
}

function git(...args) {
  return execFileSync('git', args, { cwd: root, encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore'] });
}
