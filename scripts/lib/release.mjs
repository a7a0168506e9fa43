/** The output of `npm run release`. The tests and the apps of tests/apps use it as a user does. */
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { basename, join, sep } from 'node:path';
import { zipSync } from 'fflate';
import { root } from './run.mjs';

const CDN = join(root, 'packages/element/cdn');
const read = (path) => JSON.parse(readFileSync(path, 'utf8'));

/** Manifests of the packages that npm gets, by name. */
export function manifests() {
  const paths = readdirSync(join(root, 'packages')).map((name) => join(root, 'packages', name, 'package.json'));
  return new Map(
    paths
      .filter(existsSync)
      .map(read)
      .map((each) => [each.name, each]),
  );
}

/** Reasons against publishing the packages together; empty if there are none. */
export function faultsOf(packages) {
  const { version } = read(join(root, 'package.json'));
  return [...packages.values()].flatMap((each) => {
    const own = Object.entries(each.dependencies ?? {}).filter(([name]) => name.startsWith('@gaussian-splat/'));
    return [
      ...(each.version === version ? [] : [`${each.name} is ${each.version}: expected ${version}, as the workspace`]),
      ...(each.publishConfig?.access === 'public' ? [] : [`${each.name}: expected publishConfig.access "public"`]),
      ...own
        .filter(([name, wanted]) => packages.get(name)?.version !== wanted)
        .map(([name, wanted]) => `${each.name} asks for ${name} ${wanted}: expected ${packages.get(name)?.version}`),
    ];
  });
}

/** Packs all packages into a folder. Returns the paths of the tarballs by name. */
export function packPackages(folder) {
  mkdirSync(folder, { recursive: true });
  const npm = process.platform === 'win32' ? 'npm.cmd' : 'npm';
  const args = ['pack', '--json', '--workspaces', '--pack-destination', folder];
  const options = { cwd: root, encoding: 'utf8', shell: process.platform === 'win32', maxBuffer: 1 << 26 };
  const { status, stdout, stderr } = spawnSync(npm, args, options);
  if (status !== 0) throw new Error(stderr);
  return new Map(JSON.parse(stdout).map(({ name, filename }) => [name, join(folder, filename)]));
}

/** The CDN build as a ZIP archive, with ONNX Runtime or without; source maps are left out. */
export function zipOfCdn({ withRuntime }) {
  const hashes = read(join(CDN, 'integrity.json'));
  const isIn = (file) => !file.endsWith('.map') && (withRuntime || !file.startsWith('onnxruntime'));
  const files = readdirSync(CDN, { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .map((entry) => join(entry.parentPath, entry.name).slice(CDN.length + 1))
    .filter((file) => isIn(file) && file !== 'integrity.json');
  const kept = Object.fromEntries(Object.entries(hashes).filter(([file]) => isIn(file)));
  const text = (value) => Buffer.from(`${JSON.stringify(value, null, 2)}\n`);
  const integrity = Object.fromEntries(Object.entries(kept).map(([file, hash]) => [`./gaussian-splat/${file}`, hash]));
  const content = [
    ...files.map((file) => [file.split(sep).join('/'), readFileSync(join(CDN, file))]),
    ['integrity.json', text(kept)],
    ['import-map.json', text({ integrity })],
  ];
  // Same bytes from the same build.
  const mtime = new Date(1980, 0, 1);
  return zipSync(Object.fromEntries(content.map(([name, bytes]) => [`gaussian-splat/${name}`, [bytes, { mtime }]])));
}

/** Names of a package and of the workspace packages that it needs. */
export function withOwn(name, packages = manifests()) {
  const own = Object.keys(packages.get(name).dependencies ?? {}).filter((each) => packages.has(each));
  return [...new Set([name, ...own.flatMap((each) => withOwn(each, packages))])];
}

/**
 * The packages for apps as a ZIP archive, to be unpacked in an app: `vendor/*.tgz` are the element and what it needs, and
 * `vendor/react/*.tgz` and `vendor/three/*.tgz` are more for these.
 * @param tarballs {Map<string, string>} paths by name
 */
function zipOfPackages(tarballs) {
  const ofElement = withOwn('@gaussian-splat/element');
  const places = [
    ...ofElement.map((name) => ['vendor', name]),
    ...['react', 'three'].map((name) => [`vendor/${name}`, `@gaussian-splat/${name}`]),
  ];
  const entryOf = ([place, name]) => [`${place}/${basename(tarballs.get(name))}`, readFileSync(tarballs.get(name))];
  // They are compressed already.
  return zipSync(Object.fromEntries(places.map(entryOf)), { level: 0, mtime: new Date(1980, 0, 1) });
}

/**
 * Everything that a maintainer publishes, in a folder that is emptied first: `npm/*.tgz`, ZIP archives of the CDN build and of the packages for apps, and `SHA256SUMS`.
 * @returns {{ files: string[], tarballs: Map<string, string> }} the files, relative to the folder; paths of the tarballs by name
 */
export function writeRelease(folder) {
  const packages = manifests();
  const faults = faultsOf(packages);
  if (faults.length > 0) throw new Error(`The packages do not fit together:\n${faults.join('\n')}`);
  rmSync(folder, { recursive: true, force: true });
  const tarballs = packPackages(join(folder, 'npm'));
  const { version } = packages.get('@gaussian-splat/element');
  writeFileSync(join(folder, `gaussian-splat-${version}.zip`), zipOfCdn({ withRuntime: false }));
  writeFileSync(join(folder, `gaussian-splat-${version}-onnxruntime.zip`), zipOfCdn({ withRuntime: true }));
  writeFileSync(join(folder, `gaussian-splat-${version}-packages.zip`), zipOfPackages(tarballs));
  const files = readdirSync(folder, { recursive: true }).filter((file) => /\.(tgz|zip)$/.test(file));
  const digest = (file) =>
    createHash('sha256')
      .update(readFileSync(join(folder, file)))
      .digest('hex');
  writeFileSync(join(folder, 'SHA256SUMS'), files.map((file) => `${digest(file)}  ${file}\n`).join(''));
  return { files, tarballs };
}
