/** Runs test files of Node and of Chromium beside each other, and counts. */
import { relative } from 'node:path';
import { runAsync } from './processes.mjs';
import { root, TSC } from './run.mjs';
import { byGroup, byProcess } from './test-files.mjs';

/** Files that are given a second chance alone, at most: more than that is no matter of a busy machine. */
const MAX_UNSTEADY = 3;
const IN_ONE_PROCESS = 'tests/support/in-one-process.ts';
const TYPES = [TSC, '--noEmit', '--project', 'tests'];
const ESLINT = ['node_modules/eslint/bin/eslint.js', '.'];
const WORDS = ['scripts/words.mjs'];

/**
 * Chromium has the processors first, since some of its tests look at what happens in time; what draws in Node, what needs no GPU, types and the linter run beside it at
 * the lowest priority, and take what pages leave while they wait.
 * @param files paths of test files, of Node and of Chromium.
 * @param env variables of all that runs.
 * @param isStatic whether types and style are looked at, too.
 * @param failsUnsteady whether a file that passes only when it runs again, alone, has failed.
 * @returns how many tests passed, failed and were skipped, and a line for each that failed.
 */
export async function runTests({ node, browser }, { env, isStatic = false, failsUnsteady = false }) {
  const isBeside = browser.length > 0;
  const { sharing, together, alone } = byProcess(node);
  const options = { env: { ...env, NODE_ENV: 'test' }, isBeside };
  const results = await Promise.all([
    runBrowser(byGroup(browser), { ...options, isBeside: false }, failsUnsteady),
    runSharing(sharing, options),
    runAlone(alone, isBeside ? 1 : 2, options).then(async (counts) => [
      counts,
      await runSharing(together, options),
      ...(isStatic ? await runStatic(options) : []),
    ]),
  ]);
  return results.flat().reduce(sum, NONE);
}

const NONE = { passed: 0, failed: 0, skipped: 0, failures: [] };

function sum(a, b) {
  return {
    passed: a.passed + b.passed,
    failed: a.failed + b.failed,
    skipped: a.skipped + b.skipped,
    failures: [...a.failures, ...b.failures],
  };
}

/** Files in one process, and those that draw on one device. */
function runSharing(files, options) {
  return runNode(
    [IN_ONE_PROCESS],
    1,
    { ...options, env: { ...options.env, TEST_FILES: files.join(' ') } },
    files.length,
  );
}

/** Files that have a process each. */
function runAlone(files, concurrency, options) {
  return runNode(files, concurrency, options, files.length);
}

async function runNode(files, concurrency, options, count) {
  if (count === 0) return NONE;
  const reporters = ['spec', './scripts/lib/slowest-reporter.mjs'].flatMap((name) => [
    `--test-reporter=${name}`,
    '--test-reporter-destination=stdout',
  ]);
  const args = ['--import', 'tsx', '--test', `--test-concurrency=${concurrency}`, ...reporters, ...files];
  return countsOf('Node', await runAsync(process.execPath, args, options));
}

/** Types of the tests and the style of everything: one failure each, if any. */
async function runStatic(options) {
  const counts = [];
  for (const args of [TYPES, ESLINT, WORDS]) {
    const { status } = await runAsync(process.execPath, args, options);
    counts.push(status === 0 ? NONE : { ...NONE, failed: 1, failures: [`Failed: ${args.join(' ')}`] });
  }
  return counts;
}

/**
 * The pages draw on the processor, and some tests look at what a page does in time: a few files that fail while the machine is busy with something else
 * run once more, by themselves. One that passes then is named as unsteady; one that fails again has failed.
 */
async function runBrowser(groups, options, failsUnsteady) {
  const results = [];
  for (const [group, files] of Object.entries(groups))
    if (files.length > 0) results.push({ group, ...(await inChromium(group, files, options)) });
  const failed = results.flatMap(({ group, failedIn }) =>
    [...failedIn].map(([file, count]) => ({ group, file, count })),
  );
  if (failed.length > MAX_UNSTEADY) return results;
  for (const { group, file, count } of failed) {
    const again = await inChromium(group === 'dense' ? group : 'timing', [file], options);
    if (again.failed > 0) continue;
    console.log(`unsteady: ${file} failed beside the others and passed alone`);
    if (failsUnsteady) continue;
    const result = results.find(({ failedIn }) => failedIn.has(file));
    result.passed += count;
    result.failed -= count;
    result.failures = result.failures.filter((line) => !line.includes(`${file}:`));
  }
  return results;
}

/** Counts of one group of files, and those that failed with how many of their tests did. */
async function inChromium(group, files, options) {
  const args = ['node_modules/@web/test-runner/dist/bin.js', '--config', 'web-test-runner.config.mjs'];
  const env = { ...options.env, TEST_GROUP: group, TEST_FILES: files.join(' ') };
  const result = await runAsync(process.execPath, args, { ...options, env });
  const failedIn = new Map(
    [...result.text.matchAll(/^Failed: (\d+) of (.+)$/gm)].map(([, count, file]) => [
      relative(root, file).replaceAll('\\', '/'),
      Number(count),
    ]),
  );
  return { ...countsOf('Chromium', result), failedIn };
}

/** What a closing line says; a run that ended badly without naming a failure is one. */
function countsOf(name, { text, status }) {
  const line = new RegExp(`^${name}: (\\d+) passed, (\\d+) failed, (\\d+) skipped$`, 'm').exec(text);
  const [, passed = 0, failed = 0, skipped = 0] = line?.map(Number) ?? [];
  const failures = [...text.matchAll(/^Failed test: .+$/gm)].map(([failure]) => failure);
  if (status === 0 || failed > 0) return { passed, failed, skipped, failures };
  return {
    passed,
    failed: 1,
    skipped,
    failures: [...failures, `Failed: the run of ${name} ended with status ${status}`],
  };
}
