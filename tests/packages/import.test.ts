/** Importing a package on a server: in plain Node, without a browser global, and with its exports in place. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));

/** Every entry of every package's `exports` that is a module. */
function entries(): string[] {
  const folders = readdirSync(`${root}packages`).filter((folder) =>
    existsSync(`${root}packages/${folder}/package.json`),
  );
  return folders.flatMap((folder) => {
    const { name, exports } = JSON.parse(readFileSync(`${root}packages/${folder}/package.json`, 'utf8')) as {
      name: string;
      exports: Record<string, unknown>;
    };
    // Entries with types alone are imported by `import type`.
    const modules = Object.entries(exports).filter(([, target]) => Object(target).default !== undefined);
    return modules.map(([path]) => name + path.slice(1));
  });
}

/** They only give other modules types. */
const TYPES_ONLY = ['@gaussian-splat/element/vue', '@gaussian-splat/react/jsx'];

test('there are entries to import', () => assert.ok(entries().length >= 6, entries().join(', ')));

for (const entry of entries()) {
  test(`import('${entry}') works in Node`, () => {
    const script = `import('${entry}').then((module) => console.log(Object.keys(module).length))`;
    const result = spawnSync(process.execPath, ['-e', script], { cwd: root, encoding: 'utf8' });
    assert.equal(result.status, 0, result.stderr);
    assert.equal(result.stderr, '', 'nothing is printed to stderr');
    assert.equal(
      Number(result.stdout) > 0,
      !TYPES_ONLY.includes(entry),
      `${entry} exports ${result.stdout.trim()} names`,
    );
  });
}
