/** Files of tests that run in one process leave it as it was: those that do not say so by their names. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { scriptModule } from '../bench/load.js';

interface TestFiles {
  testFiles(): { readonly node: readonly string[] };
  byProcess(files: readonly string[]): { readonly together: readonly string[] };
}

const { testFiles, byProcess } = (await scriptModule('lib/test-files.mjs')) as TestFiles;
const CHANGES_PROCESS =
  /\b(globalThis|mock|memoryUsage)\b|\bprocess\.(?!platform|execPath|cwd|cpuUsage|env\.\w+\b(?! =))|performance\.now =|support\/(node-device|devices)|node-gpu/;

test('a file that changes its process, or takes a device, is named .alone.test.ts or lies where files share a device', () => {
  const { together } = byProcess(testFiles().node);
  assert.ok(together.length > 40, `${together.length} files share a process`);
  const wrong = together.filter((file) => CHANGES_PROCESS.test(readFileSync(file, 'utf8')));
  assert.deepEqual(wrong, []);
});
