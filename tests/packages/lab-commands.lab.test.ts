/** Every measurement of `npm run lab` runs to its end with its smallest arguments. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { COMMANDS } from '../../scripts/lib/lab-commands.mjs';

const root = fileURLToPath(new URL('../../', import.meta.url));
const folder = mkdtempSync(join(tmpdir(), 'gaussian-splat-lab-'));
after(() => rmSync(folder, { recursive: true }));
const shared = join(root, '../shared');
const detail = join(folder, 'levels');

function node(...args: string[]): string {
  const { status, stdout, stderr } = spawnSync(process.execPath, args, { cwd: root, encoding: 'utf8' });
  assert.equal(status, 0, stdout + stderr);
  return stdout;
}

const ping = spawnSync('npm', ['ping', '--fetch-retries=0'], { encoding: 'utf8', shell: process.platform === 'win32' });
/** Why nothing can be installed; undefined where it can. */
const offline = ping.status === 0 ? undefined : `no npm registry: ${/npm error code (\w+)/.exec(ping.stderr)?.[1]}`;

for (const [name, { smallest, installs }] of Object.entries(COMMANDS)) {
  const needsData = smallest?.some((word) => word.includes('{shared}')) && !existsSync(shared);
  const reason = needsData ? `no ${shared}` : installs && offline;
  const skip = smallest ? reason : 'needs another engine, packages of Python, or a GPU';
  test(`npm run lab -- ${name}`, { skip }, () => {
    if (smallest?.includes('{detail}'))
      node('packages/cli/bin/gaussian-splat.mjs', 'detail', 'demo/scenes/skull.spz', '--quantized', '--out', detail);
    const words = smallest?.map((word) =>
      word.replace('{shared}', shared).replace('{folder}', folder).replace('{detail}', detail),
    );
    assert.notEqual(node('scripts/lab.mjs', name, ...words!), '', 'it prints what it measured');
  });
}

test('without a name, and with an unknown one, it lists them', () => {
  const lines = (...args: string[]): string[] =>
    spawnSync(process.execPath, ['scripts/lab.mjs', ...args], { cwd: root, encoding: 'utf8' }).stdout.split('\n');
  for (const list of [lines(), lines('toString')])
    assert.deepEqual(
      list.flatMap((line) => /^ {2}([\w-]+) {2}/.exec(line)?.[1] ?? []),
      Object.keys(COMMANDS),
    );
});
