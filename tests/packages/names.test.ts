/** The linter's rule of retired names refuses declarations, and leaves references and keys of stored files alone. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));

interface Diagnostic {
  readonly code: string;
  readonly message: string;
  readonly filename: string;
  readonly labels: readonly { readonly span: { readonly offset: number } }[];
}

/** The names that the rule refuses in each source, in their order. Sources are in the package `core`, or where their key says. */
function refused(sources: Readonly<Record<string, string>>): Record<string, readonly string[]> {
  const folder = mkdtempSync(join(tmpdir(), 'names-'));
  try {
    for (const [name, source] of Object.entries(sources)) {
      const path = join(folder, name);
      mkdirSync(dirname(path), { recursive: true });
      writeFileSync(path, source);
    }
    const { stdout } = spawnSync(
      process.execPath,
      ['node_modules/oxlint/bin/oxlint', '--config', 'oxlint.config.mjs', '--format', 'json', folder],
      { cwd: root, encoding: 'utf8' },
    );
    const { diagnostics } = JSON.parse(stdout) as { diagnostics: readonly Diagnostic[] };
    const found = diagnostics.filter(({ code }) => code === 'words(retired-names)');
    found.sort((a, b) => a.labels[0].span.offset - b.labels[0].span.offset);
    const inFile = (name: string): readonly string[] =>
      found
        .filter(({ filename }) => filename.endsWith(`/${name}`))
        .map(({ message }) => /in "(\w+)"/.exec(message)?.[1] ?? message);
    return Object.fromEntries(Object.keys(sources).map((name) => [name, inFile(name)]));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

test('declarations of each kind are refused; references, parts of other words and keys of contracts are accepted', () => {
  const contract = 'export interface Instances { most: number }';
  const cases: readonly (readonly [name: string, source: string, names: readonly string[]])[] = [
    [
      'variables.ts',
      'const told = 1, { a: spare, ...leavers } = b, [pace = 2] = c;',
      ['told', 'spare', 'leavers', 'pace'],
    ],
    ['functions.ts', 'function tellAll(wish) {} const f = (LEAST_SIZE) => 0;', ['tellAll', 'wish', 'LEAST_SIZE']],
    [
      'classes.ts',
      'class PictureFrame { #colour = 1; noted() {} constructor(private readonly lever: 1) {} }',
      ['PictureFrame', 'colour', 'noted', 'lever'],
    ],
    [
      'types.ts',
      'interface A { readonly centre: number; anew(): void } type Ladder = 1;',
      ['centre', 'anew', 'Ladder'],
    ],
    ['references.ts', 'a.most = b.told; c({ spare: 1 });', []],
    ['others.ts', 'const space = 1, mostly = 2, atMost = 3, storytelling = 4;', []],
    ['packages/core/src/contract/schema.ts', contract, []],
    ['packages/core/src/schema.ts', contract, ['most']],
  ];
  assert.deepEqual(
    refused(Object.fromEntries(cases.map(([name, source]) => [name, source]))),
    Object.fromEntries(cases.map(([name, , names]) => [name, names])),
  );
});
