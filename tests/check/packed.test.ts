/** The checker as people install it: the packed packages in a folder of their own, run by the name of the command. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import {
  existsSync,
  mkdirSync,
  mkdtempSync,
  readFileSync,
  readdirSync,
  realpathSync,
  rmSync,
  symlinkSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { fixturePath } from '../support/generators.js';

const root = fileURLToPath(new URL('../../', import.meta.url));
const folder = realpathSync(mkdtempSync(join(tmpdir(), 'gaussian-check-')));
const modules = join(folder, 'node_modules');

function run(command: string, args: readonly string[], cwd = folder): { status: number | null; output: string } {
  const { status, stdout, stderr } = spawnSync(command, args, { cwd, encoding: 'utf8' });
  return { status, output: stdout + stderr };
}

/** Paths of the tarballs of some packages. */
function pack(names: readonly string[]): string[] {
  const workspaces = names.flatMap((name) => ['--workspace', `packages/${name}`]);
  const { output } = run('npm', ['pack', '--silent', '--pack-destination', folder, ...workspaces], root);
  const tarballs = output.trim().split('\n').slice(-names.length);
  for (const tarball of tarballs) assert.ok(existsSync(join(folder, tarball)) && tarball.endsWith('.tgz'), output);
  return tarballs;
}

/** The package as npm would install it: the files of the tarball, and the commands that the package names. */
function install(name: string, tarball: string): void {
  const target = join(modules, '@gaussian-splat', name);
  mkdirSync(target, { recursive: true });
  assert.equal(run('tar', ['-xzf', tarball, '--strip-components', '1', '-C', target]).status, 0);
  const { bin = {} } = JSON.parse(readFileSync(join(target, 'package.json'), 'utf8')) as {
    bin?: Record<string, string>;
  };
  mkdirSync(join(modules, '.bin'), { recursive: true });
  for (const [command, file] of Object.entries(bin)) symlinkSync(join(target, file), join(modules, '.bin', command));
}

test('packed and installed, gaussian-check runs a model and distinguishes good from bad', () => {
  const names = ['core', 'generator', 'check'];
  pack(names).forEach((tarball, k) => install(names[k], tarball));
  // Packages of others are those of this checkout.
  for (const name of readdirSync(join(root, 'node_modules'))) {
    if (
      name.startsWith('onnxruntime') ||
      ['long', 'flatbuffers', 'guid-typescript', 'platform', 'protobufjs', '@protobufjs'].includes(name)
    )
      symlinkSync(join(root, 'node_modules', name), join(modules, name));
  }
  const check = (...args: string[]): ReturnType<typeof run> => run(join(modules, '.bin', 'gaussian-check'), args);
  const good = check(fixturePath('packed.onnx'), '--run');
  assert.equal(good.status, 0, good.output);
  assert.match(good.output, /keeps the contract, header and values/);
  const bad = check(fixturePath('faulty-values.onnx'), '--run');
  assert.equal(bad.status, 1, bad.output);
  assert.match(bad.output, /contract\/not-finite/);
  assert.equal(check('--nonsense').status, 2);
});

test('the JSON Schema is in the package of core, where editors and other languages find it', () => {
  const schema = JSON.parse(readFileSync(join(modules, '@gaussian-splat/core/contract.schema.json'), 'utf8')) as object;
  assert.deepEqual(schema, JSON.parse(readFileSync(join(root, 'packages/core/contract.schema.json'), 'utf8')));
  const resolved = run(process.execPath, ['-p', "require.resolve('@gaussian-splat/core/contract.schema.json')"]);
  assert.equal(resolved.status, 0, resolved.output);
});

after(() => rmSync(folder, { recursive: true, force: true }));
