/** One corpus, two checkers: the codes of this one and of the Python exporter's (packages/exporter/tests/test_written.py) are the same. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { fileURLToPath } from 'node:url';
import { checkModel } from '@gaussian-splat/check';

const at = (path: string): string => fileURLToPath(new URL(`../fixtures/${path}`, import.meta.url));
const verdicts = JSON.parse(readFileSync(at('verdicts.json'), 'utf8')) as Record<string, string[]>;

for (const [name, codes] of Object.entries(verdicts)) {
  test(`${name}: ${codes.join(', ') || 'in order'}`, async () => {
    const { faults } = await checkModel(at(`verdicts/${name}`), { run: true });
    assert.deepEqual([...new Set(faults.map(({ code }) => code))].sort(), codes);
  });
}
