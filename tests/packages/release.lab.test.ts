/** Outputs of a release: packages that fit together, one install that needs no list, archives with the digest of every script. */
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import {
  existsSync,
  mkdirSync,
  mkdtempSync,
  readdirSync,
  readFileSync,
  rmSync,
  statSync,
  writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { unzipSync } from 'fflate';

interface Manifest {
  readonly name: string;
  readonly version: string;
  readonly dependencies?: Readonly<Record<string, string>>;
}
interface Release {
  readonly manifests: () => Map<string, Manifest>;
  readonly faultsOf: (packages: Map<string, Manifest>) => string[];
  readonly writeRelease: (folder: string) => { files: string[]; tarballs: Map<string, string> };
}
const root = fileURLToPath(new URL('../../', import.meta.url));
const isBuilt = existsSync(`${root}packages/element/cdn/integrity.json`) && existsSync(`${root}packages/react/dist`);
const skip = isBuilt ? false : 'not built: npm run build';
const { faultsOf, manifests, writeRelease } = (await import(`${root}scripts/lib/release.mjs`)) as Release;

const folder = mkdtempSync(join(tmpdir(), 'gaussian-splat-release-'));
after(() => rmSync(folder, { recursive: true }));
const release = isBuilt ? writeRelease(join(folder, 'release')) : undefined;
/**
 * Bytes that the element may take of a node_modules. Lit and fflate are 3.9 MB of it, three.js for meshes 0.9 MB, the
 * decoders of Draco and KTX2 1.5 MB: once for each of formats, the worker's text and the CDN build.
 */
const MAX_BYTES = 13_400_000;

test('packages fit together, and what does not is named', () => {
  assert.deepEqual(faultsOf(manifests()), []);
  const packages = manifests();
  const core = packages.get('@gaussian-splat/core')!;
  packages.set(core.name, { ...core, version: '0.0.9' });
  const faults = faultsOf(packages).join('\n');
  assert.match(faults, /core is 0\.0\.9: expected/);
  assert.match(faults, /element asks for @gaussian-splat\/core .*: expected 0\.0\.9/);
});

test('archives hold the CDN build, and the digest of every script in them', { skip }, () => {
  const { files } = release!;
  const archives = files.filter((file) => file.endsWith('.zip') && !file.endsWith('-packages.zip'));
  assert.equal(archives.length, 2, files.join());
  for (const archive of archives) {
    const content = unzipSync(readFileSync(join(folder, 'release', archive)));
    const names = Object.keys(content);
    const scripts = names.filter((name) => /\.m?js$/.test(name));
    const { integrity } = JSON.parse(Buffer.from(content['gaussian-splat/import-map.json']).toString()) as {
      integrity: Record<string, string>;
    };
    assert.deepEqual(Object.keys(integrity).sort(), scripts.map((name) => `./${name}`).sort());
    for (const name of scripts) {
      const digest = createHash('sha384').update(content[name]).digest('base64');
      assert.equal(integrity[`./${name}`], `sha384-${digest}`, name);
    }
    const hasRuntime = names.some((name) => name.endsWith('.wasm'));
    assert.equal(hasRuntime, archive.includes('onnxruntime'), archive);
    for (const name of ['gaussian-splat.min.js', 'embed.html', 'LICENSES.txt'])
      assert.ok(names.includes(`gaussian-splat/${name}`), name);
    assert.deepEqual(
      names.filter((name) => name.endsWith('.map')),
      [],
    );
  }
  const sums = readFileSync(join(folder, 'release/SHA256SUMS'), 'utf8');
  assert.ok(
    files.every((file) => sums.includes(`  ${file}\n`)),
    sums,
  );
});

const sizeOf = (path: string): number =>
  readdirSync(path, { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .reduce((sum, { parentPath, name }) => sum + statSync(join(parentPath, name)).size, 0);

test('one install brings the element, all that it needs, and little more', { skip }, async (t) => {
  const app = join(folder, 'app');
  mkdirSync(app);
  writeFileSync(join(app, 'package.json'), '{}');
  const archive = release!.files.find((file) => file.endsWith('-packages.zip'))!;
  for (const [name, bytes] of Object.entries(unzipSync(readFileSync(join(folder, 'release', archive))))) {
    mkdirSync(join(app, name, '..'), { recursive: true });
    writeFileSync(join(app, name), bytes);
  }
  const vendor = readdirSync(join(app, 'vendor')).filter((name) => name.endsWith('.tgz'));
  const args = ['install', ...vendor.map((name) => `./vendor/${name}`), '--no-audit', '--no-fund', '--prefer-offline'];
  const npm = spawn('npm', args, { cwd: app, shell: process.platform === 'win32' });
  let said = '';
  npm.stderr.on('data', (data) => (said += String(data)));
  const status = await new Promise((resolve) => npm.on('close', resolve));
  if (status !== 0 && /ENOTFOUND|ECONNREFUSED|ETIMEDOUT|EAI_AGAIN/.test(said)) return t.skip('npm is out of reach');
  assert.equal(status, 0, said);
  const installed = readdirSync(join(app, 'node_modules/@gaussian-splat')).sort();
  assert.deepEqual(installed, ['core', 'element', 'formats', 'generator', 'renderer']);
  assert.ok(!existsSync(join(app, 'node_modules/onnxruntime-web')), 'ONNX Runtime is for those who show generators');
  const bytes = sizeOf(join(app, 'node_modules'));
  t.diagnostic(`${bytes} bytes`);
  assert.ok(bytes < MAX_BYTES, `${bytes} bytes`);
  assert.doesNotMatch(readFileSync(join(app, 'package-lock.json'), 'utf8'), /localhost|127\.0\.0\.1/);
});
