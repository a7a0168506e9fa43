/** What npm would publish, as its linters see it: entries, types, files. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { publint } from 'publint';
import { formatMessage } from 'publint/utils';

const root = fileURLToPath(new URL('../../', import.meta.url));
const packages = readdirSync(`${root}packages`).filter((name) => existsSync(`${root}packages/${name}/package.json`));
const isBuilt = packages.every((name) => existsSync(`${root}packages/${name}/dist`));
const skip = isBuilt ? false : 'not built: npm run build';

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

  // Packages are ES modules only; what `require` made of them before Node 20.19 is not asked.
  test(`the types of ${name} are right wherever it can be imported`, { skip }, () => {
    const attw = ['node_modules/@arethetypeswrong/cli/dist/index.js', '--pack', folder, '--profile', 'esm-only'];
    const result = spawnSync(process.execPath, [...attw, '--format', 'ascii', '--no-emoji'], {
      cwd: root,
      encoding: 'utf8',
    });
    assert.equal(result.status, 0, result.stdout + result.stderr);
  });
}
