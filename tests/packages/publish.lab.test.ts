/** The packages as npm would publish them, checked by linters: entries, types, files. */
import assert from 'node:assert/strict';
import { checkPackage, createPackageFromTarballData } from '@arethetypeswrong/core';
import { spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { publint } from 'publint';
import { formatMessage } from 'publint/utils';

const root = fileURLToPath(new URL('../../', import.meta.url));
const packages = readdirSync(`${root}packages`).filter((name) => existsSync(`${root}packages/${name}/package.json`));
/** Packages that others import: the command-line package has no build and no types. */
const libraries = packages.filter((name) => existsSync(`${root}packages/${name}/tsconfig.json`));
const isBuilt = libraries.every((name) => existsSync(`${root}packages/${name}/dist`));
const skip = isBuilt ? false : 'not built: npm run build';

/** npm's report of a tarball. */
interface Tarball {
  readonly name: string;
  readonly filename: string;
  readonly size: number;
  readonly files: readonly { readonly path: string }[];
}

/** Ways to find a package that ES modules alone need not serve. */
const NOT_ASKED: readonly string[] = ['node10', 'node16-cjs'];

const packed = mkdtempSync(join(tmpdir(), 'gaussian-splat-packed-'));
after(() => rmSync(packed, { recursive: true }));
const tarballs: readonly Tarball[] = isBuilt ? pack() : [];

function pack(): Tarball[] {
  const result = spawnSync('npm', ['pack', '--json', '--workspaces', '--pack-destination', packed], {
    cwd: root,
    encoding: 'utf8',
    shell: process.platform === 'win32',
    maxBuffer: 1 << 26,
  });
  assert.equal(result.status, 0, result.stderr);
  return JSON.parse(result.stdout) as Tarball[];
}

function tarballOf(name: string): Tarball {
  const found = tarballs.find((tarball) => tarball.name === `@gaussian-splat/${name}`);
  assert.ok(found, `a tarball of ${name}`);
  return found;
}

test('there are packages to lint', () => assert.ok(packages.length >= 6, packages.join()));

for (const name of packages) {
  const folder = `${root}packages/${name}`;

  test(`publint has nothing to say about ${name}`, { skip }, async () => {
    const { messages } = await publint({ pkgDir: folder, strict: true });
    const manifest = JSON.parse(readFileSync(`${folder}/package.json`, 'utf8')) as Record<string, unknown>;
    assert.deepEqual(
      messages.map((message) => formatMessage(message, manifest)),
      [],
    );
  });
}

for (const name of libraries) {
  // Packages are ES modules only; what `require` made of them before Node 20.19 is not asked.
  test(`the types of ${name} are right wherever it can be imported`, { skip }, async () => {
    const { filename } = tarballOf(name);
    const result = await checkPackage(createPackageFromTarballData(readFileSync(`${packed}/${filename}`)));
    assert.ok(result.types, 'it has types');
    const problems = result.problems.filter(
      (problem) => !('resolutionKind' in problem) || !NOT_ASKED.includes(problem.resolutionKind),
    );
    assert.deepEqual(problems, []);
  });
}

/**
 * Upper limit of bytes in a tarball. The element's has the CDN build without source maps, and not ONNX Runtime, which is an optional peer. The decoders of Draco and KTX2, 500 kB, are in it
 * four times: for the page and for the worker, of the CDN and of bundlers. That of formats has them once, beside all readers (LCC and implicit tiles came last). The command's has the element in one file, with readers, decoders and WebAssembly.
 */
const MAX_BYTES: Readonly<Record<string, number>> = {
  element: 3_000_000,
  cli: 1_400_000,
  formats: 700_000,
  others: 550_000,
};

test('every tarball has its licence, its README and nothing that weighs', { skip }, (t) => {
  assert.equal(tarballs.length, packages.length);
  for (const { name, size, files } of tarballs) {
    const paths = files.map(({ path }) => path);
    for (const needed of ['LICENSE', 'README.md', 'package.json'])
      assert.ok(paths.includes(needed), `${name}: ${needed}`);
    t.diagnostic(`${name}: ${size} bytes in ${files.length} files`);
    const max = MAX_BYTES[name.replace('@gaussian-splat/', '')] ?? MAX_BYTES.others;
    assert.ok(size < max, `${name}: ${size} bytes`);
  }
  const element = tarballOf('element').files.map(({ path }) => path);
  assert.ok(element.includes('cdn/gaussian-splat.min.js') && element.includes('cdn/integrity.json'), element.join());
  assert.deepEqual(
    element.filter((path) => path.startsWith('cdn/onnxruntime/')),
    [],
  );
});

test('npm publishes every package in a dry run, and corrects nothing', { skip }, () => {
  // Without a network, npm would repeat each request for a minute.
  const options = ['--dry-run', '--workspaces', '--loglevel=warn', '--fetch-retries=0'];
  const { status, stdout, stderr } = spawnSync('npm', ['publish', ...options], {
    ...{ cwd: root, encoding: 'utf8', shell: process.platform === 'win32', maxBuffer: 1 << 26 },
  });
  assert.equal(status, 0, stderr);
  // The only allowed error: the user is not logged in.
  const warnings = stderr.split('\n').filter((line) => /npm warn/i.test(line) && !/to be logged in/.test(line));
  assert.deepEqual(warnings, []);
  for (const { name } of tarballs) assert.ok(stdout.includes(`+ ${name}@`), `${name}: ${stdout}`);
});

test('packages that say where their sources are say it as the workspace does', () => {
  const read = (folder: string) =>
    JSON.parse(readFileSync(`${folder}/package.json`, 'utf8')) as Record<string, unknown>;
  const workspace = read(root) as { repository?: { url: string } };
  for (const name of packages) {
    const { repository, license, keywords } = read(`${root}packages/${name}`);
    const expected = workspace.repository && { ...workspace.repository, directory: `packages/${name}` };
    assert.deepEqual([repository, license], [expected, 'MIT'], name);
    assert.ok(Array.isArray(keywords) && keywords.includes('gaussian-splatting'), `${name}: keywords`);
  }
});
