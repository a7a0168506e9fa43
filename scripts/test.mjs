/**
 * `npm test`: installs what is missing (Node packages, a Chromium), builds, and runs every test: types, then what draws in Node (stages on Dawn, images against the
 * oracle), then real Chromium with WebGPU, with what needs no GPU and the linter beside it.
 * `npm test -- PATTERN` runs only the Node test files whose path contains PATTERN; `npm test -- --full` runs whole lists where otherwise a part stands for all.
 */
import { spawn, spawnSync } from 'node:child_process';
import { readdirSync } from 'node:fs';
import { constants, setPriority } from 'node:os';
import { join, relative } from 'node:path';
import { chromiumVersion, ensureChromium } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { build, ensureDependencies } from './lib/prepare.mjs';
import { must, root } from './lib/run.mjs';

/** Files that are given a second chance alone, at most: more than that is no matter of a busy machine. */
const MOST_UNSTEADY = 3;
/** Test files that need no GPU: they and the linter take what Chromium, which often waits, leaves of the processors. */
const WITHOUT_GPU = /^tests.(check|contract|element|formats|frameworks|onnx|oracle|packages)\b|oracle-reference/;

ensureDependencies();
const chromium = ensureChromium();
console.log(`Chromium: ${chromiumVersion(chromium)} at ${chromium}`);
build();

const words = process.argv.slice(2);
const pattern = words.find((word) => word !== '--full');
const extent = words.includes('--full') ? { TESTS: 'full', STABILITY: 'full', SITE: 'full' } : {};
const env = { ...gpuEnvironment(), ...extent, CHROMIUM: chromium };
const totals = { passed: 0, failed: 0, skipped: 0 };

const files = testFiles(join(root, 'tests'));
const withoutGpu = files.filter((file) => WITHOUT_GPU.test(file));
if (pattern !== undefined) {
  countNodeTests(runAndCapture(...nodeTests(files.filter((file) => file.includes(pattern)))));
} else {
  must(process.execPath, ['node_modules/typescript/bin/tsc', '--noEmit', '--project', 'tests']);
  countNodeTests(runAndCapture(...nodeTests(files.filter((file) => !withoutGpu.includes(file)))));
  const tests = runBeside(...nodeTests(withoutGpu, 1));
  const lint = runBeside(process.execPath, ['node_modules/eslint/bin/eslint.js', '.']);
  await runBrowserTests();
  for (const { text } of [await tests, await lint]) process.stdout.write(text);
  countNodeTests(await tests);
  totals.failed += (await lint).status === 0 ? 0 : 1;
}
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

/** The command for some test files of Node. */
function nodeTests(list, concurrency = 2) {
  const options = ['--import', 'tsx', '--test', '--test-reporter', 'spec', '--test-concurrency', String(concurrency)];
  return [process.execPath, [...options, ...list]];
}

function countNodeTests({ text, status }) {
  const count = (name) => Number(new RegExp(`^. ${name} (\\d+)$`, 'm').exec(text)?.[1] ?? 0);
  const failed = count('fail') + count('cancelled');
  totals.passed += count('pass');
  totals.failed += status !== 0 && failed === 0 ? 1 : failed;
  totals.skipped += count('skipped') + count('todo');
}

/**
 * The pages draw on the processor, and some tests look at what a page does in time: a few files that fail while the machine is busy with something else
 * run once more, by themselves. One that passes then is named as unsteady; one that fails again has failed.
 */
async function runBrowserTests() {
  const first = await runInChromium([]);
  const isFew = first.files.length > 0 && first.files.length <= MOST_UNSTEADY;
  // The group of dense screens runs beside whatever files are named.
  const named = first.files.filter((file) => !file.includes('high-density'));
  const again = named.length > 0 ? ['--files', ...named] : ['--group', 'high-density'];
  const second = isFew ? await runInChromium(again) : undefined;
  for (const file of second?.status === 0 ? first.files : [])
    console.log(`unsteady: ${relative(root, file)} failed beside the others and passed alone`);
  const { failed, status } = second ?? first;
  totals.passed += first.passed + (second ? first.failed - second.failed : 0);
  totals.failed += status !== 0 && failed === 0 ? 1 : failed;
  totals.skipped += first.skipped;
}

/** Counts of a run, and the files that failed. */
async function runInChromium(options) {
  const { text, status } = await runAsync(process.execPath, [
    'node_modules/@web/test-runner/dist/bin.js',
    '--config',
    'web-test-runner.config.mjs',
    ...options,
  ]);
  const [, passed = 0, failed = 0, skipped = 0] =
    /^Chromium: (\d+) passed, (\d+) failed, (\d+) skipped$/m.exec(text)?.map(Number) ?? [];
  return { passed, failed, skipped, status, files: [...text.matchAll(/^Failed: (.+)$/gm)].map(([, file]) => file) };
}

function environment() {
  return { ...process.env, ...env, NODE_ENV: 'test' };
}

function withoutColours(text) {
  return text.replace(/\u001b\[[0-9;]*[A-Za-z]/g, '');
}

/** Runs a command, shows its output, and returns it with the exit status. */
function runAndCapture(command, args) {
  const options = { cwd: root, env: environment(), encoding: 'utf8', maxBuffer: 1 << 28 };
  const result = spawnSync(command, args, { ...options, stdio: ['ignore', 'pipe', 'inherit'] });
  const text = result.stdout ?? '';
  process.stdout.write(text);
  return { text: withoutColours(text), status: result.status ?? 1 };
}

/** The same, while something else goes on here. */
function runAsync(command, args, { isShown = true, priority = 0 } = {}) {
  const child = spawn(command, args, { cwd: root, env: environment(), stdio: ['ignore', 'pipe', 'inherit'] });
  try {
    if (priority !== 0) setPriority(child.pid, priority);
  } catch {
    // A system that does not let it: then it runs as the rest does.
  }
  const chunks = [];
  child.stdout.on('data', (chunk) => {
    chunks.push(chunk);
    if (isShown) process.stdout.write(chunk);
  });
  return new Promise((resolve) => {
    const end = (status) => resolve({ text: withoutColours(Buffer.concat(chunks).toString()), status: status ?? 1 });
    child.on('error', () => end(1)).on('close', end);
  });
}

/** Runs a command when nothing else wants the processor; its output is kept until then. */
function runBeside(command, args) {
  return runAsync(command, args, { isShown: false, priority: constants.priority.PRIORITY_LOW });
}
