/** The element's core knows no feature: each is named in the table of features and in at most one other file. */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import ts from 'typescript';

const root = fileURLToPath(new URL('../../', import.meta.url));
const SOURCES = 'packages/element/src/';
const MAX_FILES = 2;
const MAX_LINES = 10_000;

/** Names of features in code. A verb such as `measured` is no name. */
const NAMES = {
  walk: /walk/i,
  xr: /\b(xr|vr|ar)\b|Xr[A-Z]|XR/,
  ruler: /ruler/i,
  sky: /\bsky|Sky/,
  effects: /effects/i,
};

/** Returns the code of a file without comments. */
function codeOf(path: string): string {
  const file = ts.createSourceFile(path, readFileSync(root + path, 'utf8'), ts.ScriptTarget.Latest, true);
  return ts.createPrinter({ removeComments: true }).printFile(file);
}

test('a feature is named in the table and in at most one other file outside its folder', () => {
  const files = readdirSync(root + SOURCES, { recursive: true, encoding: 'utf8' })
    .filter((name) => name.endsWith('.ts') && !name.startsWith('generated/'))
    .map((name) => [name, codeOf(SOURCES + name)] as const);
  assert.ok(files.length > 100, `${files.length} files`);
  for (const [name, pattern] of Object.entries(NAMES)) {
    const naming = files
      .filter(([path, code]) => !path.startsWith(`features/${name}/`) && pattern.test(code))
      .map(([path]) => path);
    assert.ok(naming.includes('viewer/feature-table.ts'), `${name}: ${naming.join()}`);
    assert.ok(naming.length <= MAX_FILES, `${name}: ${naming.join()}`);
  }
});

test('what a newcomer reads has at most 10,000 lines', () => {
  const text = readFileSync(`${root}CONTRIBUTING.md`, 'utf8');
  const [, section] = /## What to read first\n([^]*?)\n## /.exec(text) ?? [];
  const patterns = [...section.matchAll(/`(packages\/[^`]+\.ts)`/g)].map(([, pattern]) => pattern);
  assert.ok(patterns.length >= 4, patterns.join());
  let lines = 0;
  for (const pattern of patterns) {
    const [, folder, names] = /^(.*)\/\{([^}]*)\}\.ts$/.exec(pattern) ?? [];
    const found = names
      ? names.split(',').map((name) => `${folder}/${name}.ts`)
      : [...pattern.matchAll(/^(.*)\/\{([^}]*)\}\/\*\.ts$/g)].flatMap(([, parent, folders]) =>
          folders.split(',').flatMap((each) =>
            readdirSync(`${root}${parent}/${each}`)
              .filter((name) => name.endsWith('.ts'))
              .map((name) => `${parent}/${each}/${name}`),
          ),
        );
    assert.ok(found.length > 0, pattern);
    for (const path of found) lines += readFileSync(root + path, 'utf8').split('\n').length - 1;
  }
  assert.ok(lines > 5_000 && lines <= MAX_LINES, `${lines} lines`);
});
