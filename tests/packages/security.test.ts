/** Each promise of SECURITY.md names tests that hold it, and these name the promise. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
const text = readFileSync(`${root}SECURITY.md`, 'utf8');
const promises = text.slice(text.indexOf('## What is promised'), text.indexOf('## What is not')).split(/\n- (?=\*\*)/);

for (const promise of promises.slice(1)) {
  const [, title] = /^\*\*(.+?)\.?\*\*/.exec(promise)!;
  test(`SECURITY.md: ${title}`, () => {
    const [, list = ''] = /Tests: ((?:`[^`]+`,?\s*)+)/.exec(promise) ?? [];
    const files = [...list.matchAll(/`([^`]+)`/g)].map(([, file]) => file);
    assert.ok(files.length > 0, 'names a test');
    for (const file of files) {
      const source = readFileSync(root + file, 'utf8');
      assert.match(source, /\b(test|it|itInLab|describe)\(|recipe|def test_/, `${file} has tests`);
      assert.ok(source.includes(`"${title}"`), `${file} names "${title}" in a comment that begins with SECURITY.md`);
    }
  });
}

test('the code that ships is listed', () => {
  const { dependencies, devDependencies } = JSON.parse(readFileSync(`${root}package.json`, 'utf8')) as Record<
    'dependencies' | 'devDependencies',
    Record<string, string>
  >;
  const three = { ...dependencies, ...devDependencies }.three;
  for (const name of ['Lit', 'fflate', 'ONNX Runtime', `three.js ${three}`, 'meshoptimizer'])
    assert.ok(text.includes(name), name);
});
