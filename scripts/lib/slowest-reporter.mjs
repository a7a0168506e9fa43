/** A reporter for Node's test runner, beside another: the test files that took longest, the tests that failed, and one line that counts all tests. */
import { relative } from 'node:path';
import { fileURLToPath } from 'node:url';
import { root } from './run.mjs';

/** Files that are printed, at most. */
const MAX = 12;
/** Below this nothing is worth a look, in milliseconds. */
const SHORT_MS = 1_000;

/** A test that failed, in one line: what `npm test` repeats at its end. */
export function failureLine(file, name, message = '') {
  return `Failed test: ${file}: ${name}: ${String(message).replace(/\s+/g, ' ').slice(0, 300)}\n`;
}

export default async function* slowest(source) {
  const files = new Map();
  const counts = { passed: 0, failed: 0, skipped: 0 };
  const failures = [];
  for await (const { type, data } of source) {
    if (type !== 'test:pass' && type !== 'test:fail') continue;
    const isSuite = data.details?.type === 'suite';
    if (type === 'test:fail') {
      counts.failed += isSuite ? 0 : 1;
      if (!isSuite) failures.push(data);
    } else if (!isSuite) counts[data.skip !== undefined || data.todo !== undefined ? 'skipped' : 'passed']++;
    if (data.nesting !== 0 || data.file === undefined) continue;
    const path = pathOf(data.file);
    files.set(path, (files.get(path) ?? 0) + (data.details?.duration_ms ?? 0));
  }
  const rows = [...files].filter(([, ms]) => ms >= SHORT_MS).sort(([, a], [, b]) => b - a);
  for (const [path, ms] of rows.slice(0, MAX)) yield `${(ms / 1000).toFixed(0).padStart(4)} s ${path}\n`;
  for (const { name, file, details } of failures)
    yield failureLine(pathOf(file), name, details?.error?.cause?.message ?? details?.error?.message);
  yield `Node: ${counts.passed} passed, ${counts.failed} failed, ${counts.skipped} skipped\n`;
}

function pathOf(file = '') {
  return relative(root, file.startsWith('file:') ? fileURLToPath(file) : file);
}
