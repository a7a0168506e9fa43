/** Files that know one another cannot be read, tested or moved alone. A few that belong together may; a long circle is a missing interface. */
import { existsSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import assert from 'node:assert/strict';
import { circlesOf, importsIn } from '../../scripts/lib/import-circles.mjs';

const MAX_FILES = 4;
const PACKAGES = fileURLToPath(new URL('../../packages/', import.meta.url));

test('a circle is found across files, and by way of types alone', () => {
  const graph = new Map([
    ['a.ts', ['b.ts']],
    ['b.ts', ['c.ts', 'd.ts']],
    ['c.ts', ['a.ts']],
    ['d.ts', []],
  ]);
  assert.deepEqual(circlesOf(graph), [['a.ts', 'b.ts', 'c.ts']]);
});

for (const name of readdirSync(PACKAGES).filter((each) => existsSync(join(PACKAGES, each, 'src/index.ts')))) {
  test(`${name}: no more than ${MAX_FILES} files import one another in a circle, types included`, () => {
    const graph = importsIn(join(PACKAGES, name, 'src'));
    assert.ok(graph.size > 0 && [...graph.values()].some((imported) => imported.length > 0), 'imports are found');
    assert.deepEqual(
      circlesOf(graph).filter(({ length }) => length > MAX_FILES),
      [],
    );
  });
}
