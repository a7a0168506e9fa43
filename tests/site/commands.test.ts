/** Commands in documents, scripts and comments exist, with the options and files that are named. */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
const { testFiles } = (await import(new URL('../../scripts/lib/test-files.mjs', import.meta.url).href)) as {
  testFiles: () => { node: readonly string[]; browser: readonly string[] };
};
const read = (path: string): string => readFileSync(join(root, path), 'utf8');

const NOT_OURS = /(^|\/)(node_modules|dist|cdn|generated|decisions|\.[^/]+)$/;

function filesIn(folder: string, ending: RegExp): string[] {
  return readdirSync(join(root, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = folder === '.' ? entry.name : `${folder}/${entry.name}`;
    if (entry.isDirectory()) return NOT_OURS.test(path) ? [] : filesIn(path, ending);
    return ending.test(path) ? [path] : [];
  });
}

const texts = ['docs', 'packages', 'demo', 'scripts', 'tests', 'benchmarks']
  .flatMap((folder) => filesIn(folder, /\.(md|njk|html|mjs|js|ts|tsx|py|wgsl)$/))
  .concat('README.md', 'CONTRIBUTING.md', 'SECURITY.md', 'CHANGELOG.md', 'web-test-runner.config.mjs')
  // The text of this file has patterns of commands.
  .filter((path) => path !== 'tests/site/commands.test.ts')
  .map((path) => ({ path, text: read(path) }));

/** Every match of a pattern, with the file and the groups. */
const matches = (pattern: RegExp): { path: string; groups: string[] }[] =>
  texts.flatMap(({ path, text }) => [...text.matchAll(pattern)].map(([, ...groups]) => ({ path, groups })));

test('options of gaussian-splat are those of the usage of the command', () => {
  const [, table] = /const COMMANDS = \{([^}]+)\}/.exec(read('packages/cli/bin/gaussian-splat.mjs'))!;
  const names = [...table.matchAll(/^ {2}(\w+):/gm)].map(([, name]) => name);
  assert.ok(names.length >= 8, names.join());
  const usageOf = (name: string): string => {
    const text = read(name === 'check' ? 'packages/check/src/main.ts' : `packages/cli/src/${name}.mjs`);
    const shared = [...text.matchAll(/import \{[^}]*_USAGE\b[^}]*\} from '\.\/(.+)';/g)];
    return [text, ...shared.map(([, path]) => read(`packages/cli/src/${path}`))].join('\n');
  };
  const called = matches(/gaussian-splat(?: --|\/cli)? ([a-z]+) ([^\n`|]*)/g).filter(({ groups: [name] }) =>
    names.includes(name),
  );
  assert.ok(called.length > 30, `${called.length} calls`);
  const unknown = called.flatMap(({ path, groups: [name, words] }) =>
    [...words.matchAll(/(?:^|\s)--([a-z][a-z-]*)/g)]
      .filter(([, option]) => !new RegExp(`--${option}\\b|'?${option}'?: `).test(usageOf(name)))
      .map(([, option]) => `${path}: gaussian-splat ${name} --${option}`),
  );
  assert.deepEqual(unknown, []);
});

test('no document runs a program of npm by the name of a command, because others may publish it', () => {
  assert.deepEqual(matches(/npx gaussian-/g).map(({ path }) => path), []); // prettier-ignore
});

test('scripts, test files and patterns of test files exist', () => {
  const { scripts } = JSON.parse(read('package.json')) as { scripts: object };
  const { node, browser } = testFiles();
  const isMissing = {
    script: (name: string) => !(name in scripts),
    pattern: (pattern: string) => !node.some((file) => file.includes(pattern)),
    file: (file: string) => !existsSync(join(root, file)) && !existsSync(join(root, 'packages/exporter', file)),
  };
  const named = [
    ...matches(/npm run (?!--)((?:lab|test):[a-z:]+|build|release|lint)\b/g).map((m) => ['script', m] as const),
    ...matches(/npm test -- ((?!PATTERN)[a-z][\w./-]*[\w])/g).map((m) => ['pattern', m] as const),
    ...matches(/\b(tests\/[\w./-]+\.test\.ts)\b/g).map((m) => ['file', m] as const),
  ];
  assert.ok(named.length > 100, `${named.length} names`);
  assert.ok(browser.length > 0);
  const missing = named
    .filter(([kind, { groups }]) => isMissing[kind](groups[0]))
    .map(([kind, { path, groups }]) => `${path}: ${kind} ${groups[0]}`);
  assert.deepEqual([...new Set(missing)], []);
});
