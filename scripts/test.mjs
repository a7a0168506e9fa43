/**
 * `npm test`: installs what is missing (Node packages, a Chromium), builds, and runs every test: lint and types, then
 * everything that runs in Node (units, stages on Dawn, images against the oracle), then real Chromium with WebGPU.
 * `npm test -- PATTERN` runs only the Node test files whose path contains PATTERN; `npm test -- --full` runs whole lists where otherwise a part stands for all.
 */
import { spawnSync } from 'node:child_process';
import { readdirSync } from 'node:fs';
import { join, relative } from 'node:path';
import { chromiumVersion, ensureChromium } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { build, ensureDependencies } from './lib/prepare.mjs';
import { must, root } from './lib/run.mjs';

/** Files that are given a second chance alone, at most: more than that is no matter of a busy machine. */
const MOST_UNSTEADY = 3;

ensureDependencies();
const chromium = ensureChromium();
console.log(`Chromium: ${chromiumVersion(chromium)} at ${chromium}`);
build();

const words = process.argv.slice(2);
const pattern = words.find((word) => word !== '--full');
const extent = words.includes('--full') ? { TESTS: 'full', STABILITY: 'full', SITE: 'full' } : {};
const env = { ...gpuEnvironment(), ...extent, CHROMIUM: chromium };
const totals = { passed: 0, failed: 0, skipped: 0 };

if (pattern === undefined) {
  must(process.execPath, ['node_modules/typescript/bin/tsc', '--noEmit', '--project', 'tests']);
  must(process.execPath, ['node_modules/eslint/bin/eslint.js', '.']);
}
runNodeTests();
if (pattern === undefined) runBrowserTests();
console.log(`\n${totals.passed} passed, ${totals.failed} failed, ${totals.skipped} skipped`);
process.exit(totals.failed > 0 || totals.passed === 0 ? 1 : 0);

/** Test files of Node: browser folders belong to the test runner in Chromium. */
function testFiles(folder) {
  return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const path = join(folder, entry.name);
    if (entry.isDirectory()) return entry.name === 'browser' ? [] : testFiles(path);
    return entry.name.endsWith('.test.ts') ? [relative(root, path)] : [];
  });
}

function runNodeTests() {
  const files = testFiles(join(root, 'tests')).filter((file) => pattern === undefined || file.includes(pattern));
  const output = runAndCapture(process.execPath, [
    ...['--import', 'tsx', '--test', '--test-reporter', 'spec', '--test-concurrency', '2'],
    ...files,
  ]);
  const count = (name) => Number(new RegExp(`^. ${name} (\\d+)$`, 'm').exec(output.text)?.[1] ?? 0);
  totals.passed += count('pass');
  totals.failed += count('fail') + count('cancelled');
  totals.skipped += count('skipped') + count('todo');
  if (output.status !== 0 && totals.failed === 0) totals.failed++;
}

/**
 * The pages draw on the processor, and some tests look at what a page does in time: a few files that fail while the machine is busy with something else
 * run once more, by themselves. One that passes then is named as unsteady; one that fails again has failed.
 */
function runBrowserTests() {
  const first = runInChromium([]);
  const isFew = first.files.length > 0 && first.files.length <= MOST_UNSTEADY;
  // The group of dense screens runs beside whatever files are named.
  const named = first.files.filter((file) => !file.includes('high-density'));
  const again = named.length > 0 ? ['--files', ...named] : ['--group', 'high-density'];
  const second = isFew ? runInChromium(again) : undefined;
  for (const file of second?.status === 0 ? first.files : [])
    console.log(`unsteady: ${relative(root, file)} failed beside the others and passed alone`);
  const { failed, status } = second ?? first;
  totals.passed += first.passed + (second ? first.failed - second.failed : 0);
  totals.failed += status !== 0 && failed === 0 ? 1 : failed;
  totals.skipped += first.skipped;
}

/** Counts of a run, and the files that failed. */
function runInChromium(options) {
  const { text, status } = runAndCapture(process.execPath, [
    'node_modules/@web/test-runner/dist/bin.js',
    '--config',
    'web-test-runner.config.mjs',
    ...options,
  ]);
  const [, passed = 0, failed = 0, skipped = 0] =
    /^Chromium: (\d+) passed, (\d+) failed, (\d+) skipped$/m.exec(text)?.map(Number) ?? [];
  return { passed, failed, skipped, status, files: [...text.matchAll(/^Failed: (.+)$/gm)].map(([, file]) => file) };
}

/** Runs a command, shows its output, and returns it with the exit status. */
function runAndCapture(command, args) {
  const result = spawnSync(command, args, {
    cwd: root,
    env: { ...process.env, ...env, NODE_ENV: 'test' },
    stdio: ['ignore', 'pipe', 'inherit'],
    encoding: 'utf8',
    maxBuffer: 1 << 28,
  });
  const text = result.stdout ?? '';
  process.stdout.write(text);
  return { text: text.replace(/\u001b\[[0-9;]*[A-Za-z]/g, ''), status: result.status ?? 1 };
}
