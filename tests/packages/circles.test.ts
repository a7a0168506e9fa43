/** Files that import one another in a circle, types included, can only be understood together: circles stay small. */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const MAX_FILES = 4;
const IMPORT = /(?:from|import\()\s*'(\.[^']+)\.js'/g;

/** Files of a package that each file imports. */
function importsOf(folder: string): ReadonlyMap<string, readonly string[]> {
  const files = readdirSync(folder, { recursive: true, encoding: 'utf8' }).filter((name) => name.endsWith('.ts'));
  const paths = files.map((name) => join(folder, name));
  const targetsOf = (path: string): string[] =>
    [...readFileSync(path, 'utf8').matchAll(IMPORT)]
      .map(([, target]) => join(dirname(path), `${target}.ts`))
      .filter(existsSync);
  return new Map(paths.map((path) => [path, targetsOf(path)]));
}

/** All files that a file imports, and those that they import. */
function reachedFrom(start: string, imports: ReadonlyMap<string, readonly string[]>): Set<string> {
  const reached = new Set<string>();
  const next = [...imports.get(start)!];
  for (let path = next.pop(); path !== undefined; path = next.pop()) {
    if (reached.has(path)) continue;
    reached.add(path);
    next.push(...(imports.get(path) ?? []));
  }
  return reached;
}

for (const name of ['core', 'renderer', 'economise']) {
  test(`@gaussian-splat/${name}: at most ${MAX_FILES} files import one another in a circle`, () => {
    const imports = importsOf(fileURLToPath(new URL(`../../packages/${name}/src/`, import.meta.url)));
    const reached = new Map([...imports.keys()].map((path) => [path, reachedFrom(path, imports)]));
    assert.ok(reached.size > 20, 'files are found');
    for (const [path, own] of reached) {
      const circle = [...own].filter((other) => reached.get(other)?.has(path));
      assert.ok(circle.length <= MAX_FILES, circle.join('\n'));
    }
  });
}
