/** Runs test files of Node and of Chromium beside each other, and counts. */
import { availableParallelism } from 'node:os';
import { runAsync } from './processes.mjs';
import { TSC } from './run.mjs';
import { byGroup, byProcess, isLaboratory } from './test-files.mjs';

/** Files that are given a second chance alone, at most: more than that is no matter of a busy machine. */
const MAX_UNSTEADY = 3;
/** On machines with this many CPU cores or more, each file of a laboratory run has its own process. */
const MIN_PROCESSORS_OF_EACH = 8;
/** Ports between two test servers, in case one is taken. */
const PORT_STEP = 10;
const IN_ONE_PROCESS = 'tests/support/in-one-process.ts';
const TYPES = [TSC, '--noEmit', '--project', 'tests'];
const LINTER = ['node_modules/oxlint/bin/oxlint', '--config', 'oxlint.config.mjs'];
const WORDS = ['scripts/words.mjs'];

/**
 * Chromium has CPU priority, since some of its tests measure time. Tests that draw in Node, tests without a GPU, types and the linter run beside it at the lowest priority, while pages wait. Those of the laboratory run after it: they take minutes of all CPU cores.
 * @param files paths of test files, of Node and of Chromium.
 * @param env variables of all that runs.
 * @param built resolves when bundles and site are available. Stages, images, types and style need the packages alone, and are tested before.
 * @param isStatic whether types and style are checked, too.
 * @param isLab whether Node follows Chromium, or each file has a process of its own on machines with many CPU cores.
 * @returns how many tests passed, failed and were skipped, and a line for each that failed.
 */
export async function runTests({ node, browser }, { env, built, isStatic = false, isLab = false }) {
  if (isLab) await built;
  if (isLab && availableParallelism() >= MIN_PROCESSORS_OF_EACH) return runEach({ node, browser }, env);
  const isBeside = browser.length > 0 && !isLab;
  const { sharing, together, alone } = byProcess(node);
  const options = { env: { ...env, NODE_ENV: 'test' }, isBeside };
  const pages = built.then(() => runBrowser(byGroup(browser), { ...options, isBeside: false }));
  if (isLab) await pages;
  const results = await Promise.all([
    pages,
    runSharing(sharing, options),
    built.then(() => runSharing(together, options)),
    inTurn(...(isStatic ? [() => runStatic(options)] : []), () => built.then(() => runAlone(alone, 2, options))),
  ]);
  return total(await secondChance(results.flat(), options));
}

/** Counts of some runs, one after the other. */
async function inTurn(...runs) {
  const counts = [];
  for (const run of runs) counts.push(await run());
  return counts.flat();
}

/** Every file in its own process, on half of the CPU cores. */
async function runEach({ node, browser }, env) {
  const optionsAt = (slot) => ({
    env: { ...env, NODE_ENV: 'test', TEST_PORT: String(8000 + PORT_STEP * slot) },
    isBeside: true,
  });
  const { sharing, together, alone } = byProcess(node);
  const { timing, ...others } = byGroup(browser);
  const longestFirst = (files) => [...files].sort((a, b) => isLaboratory(b) - isLaboratory(a));
  const inNode = (files) => files.map((file) => (options) => runAlone([file], 1, options));
  const ofGroup = ([group, files]) => files.map((file) => (options) => inChromium(group, [file], options));
  // Files that are alone take longest, above all those of the laboratory, and come first.
  const jobs = [
    ...inNode(longestFirst(alone)),
    ...ofGroup(['timing', timing]),
    ...inNode(longestFirst([...sharing, ...together])),
    ...Object.entries(others).flatMap(ofGroup),
  ];
  const results = [];
  const work = async (slot) => {
    for (let job = jobs.shift(); job !== undefined; job = jobs.shift()) results.push(await job(optionsAt(slot)));
  };
  await Promise.all(Array.from({ length: availableParallelism() >> 1 }, (_, slot) => work(slot)));
  return total(await secondChance(results, optionsAt(0)));
}

/**
 * Pages draw on the CPU, and connections have time limits: a few files that fail while the machine is busy run once more, alone. One that passes then is named as unsteady; one that fails again has failed.
 */
async function secondChance(results, options) {
  const failed = results.flatMap((result) =>
    [...(result.failedIn ?? [])].map(([file, count]) => ({ result, file, count })),
  );
  // A test that is written in another file, for several, cannot run alone.
  if (failed.length > MAX_UNSTEADY || failed.some(({ file }) => !file.endsWith('.test.ts'))) return results;
  for (const { result, file, count } of failed) {
    const again = await rerun(file, result.group, { ...options, isBeside: false });
    if (again.failed > 0) continue;
    console.log(`unsteady: ${file} failed beside the others and passed alone`);
    result.passed += count;
    result.failed -= count;
    result.failures = result.failures.filter((line) => !line.includes(`${file}:`));
  }
  return results;
}

const rerun = (file, group, options) =>
  group === undefined
    ? runAlone([file], 1, options)
    : inChromium(group === 'dense' ? group : 'timing', [file], options);

const NONE = { passed: 0, failed: 0, skipped: 0, failures: [] };

const total = (results) => results.reduce(sum, NONE);

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
  return countsOf('Node', await runAsync(process.execPath, args, options), files);
}

/** Types of the tests and the style of everything: one failure each, if any. */
async function runStatic(options) {
  const counts = [];
  for (const args of [TYPES, LINTER, WORDS]) {
    const { status } = await runAsync(process.execPath, args, options);
    counts.push(status === 0 ? NONE : { ...NONE, failed: 1, failures: [`Failed: ${args.join(' ')}`] });
  }
  return counts;
}

async function runBrowser(groups, options) {
  const results = [];
  for (const [group, files] of Object.entries(groups))
    if (files.length > 0) results.push(await inChromium(group, files, options));
  return results;
}

async function inChromium(group, files, options) {
  const args = ['node_modules/@web/test-runner/dist/bin.js', '--config', 'web-test-runner.config.mjs'];
  const env = { ...options.env, TEST_GROUP: group, TEST_FILES: files.join(' ') };
  return { group, ...countsOf('Chromium', await runAsync(process.execPath, args, { ...options, env }), files) };
}

/** The sentence of a closing line, and the files that failed. A run that failed without naming a test counts as a failure, of its file if it has one. */
function countsOf(name, { text, status }, files) {
  const line = new RegExp(`^${name}: (\\d+) passed, (\\d+) failed, (\\d+) skipped$`, 'm').exec(text);
  const [, passed = 0, failed = 0, skipped = 0] = line?.map(Number) ?? [];
  const failures = [...text.matchAll(/^Failed test: .+$/gm)].map(([failure]) => failure);
  const failedIn = new Map();
  for (const failure of failures) {
    const [, file] = /^Failed test: ([^:]+): /.exec(failure) ?? [];
    failedIn.set(file, (failedIn.get(file) ?? 0) + 1);
  }
  if (status === 0 || failed > 0) return { passed, failed, skipped, failures, failedIn };
  const [file = ''] = files;
  const ended = `Failed test: ${file}: the run of ${name} ended with status ${status}`;
  return {
    ...{ passed, failed: 1, skipped, failures: [...failures, ended] },
    failedIn: new Map(files.length === 1 ? [[file, 1]] : []),
  };
}
