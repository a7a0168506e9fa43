/**
 * Tests in real Chromium with WebGPU, on SwiftShader: `npm test`, or after `npm run build`
 * `npx web-test-runner [--files tests/element/browser/lifecycle.alone.test.ts]`; for high-density.lab.test.ts with TEST_GROUP=dense. CHROMIUM names the browser;
 * GAUSSIAN_SPLAT_GPU=system takes the machine's own GPU instead of SwiftShader.
 */
import { mkdirSync, writeFileSync } from 'node:fs';
import { basename, join, relative } from 'node:path';
import { defaultReporter } from '@web/test-runner';
import { playwrightLauncher } from '@web/test-runner-playwright';
import { findChromium, gpuFlags } from './scripts/lib/chromium.mjs';
import { root } from './scripts/lib/run.mjs';
import { DENSE, SHARED_PAGES } from './scripts/lib/test-files.mjs';
import { failureLine } from './scripts/lib/slowest-reporter.mjs';
import { pageCommands } from './tests/element/browser/support/commands.mjs';
import { hostileServer, startOtherOrigin } from './tests/element/browser/support/server.mjs';
import { typescript } from './tests/element/browser/support/typescript.mjs';

/**
 * Pages that run beside others find what the search for variants finds on SwiftShader, which takes a second of each page. Those that run alone, and those of the laboratory, search.
 */
const SECOND_VISIT = `{
  const { getItem } = Storage.prototype;
  const kept = ${JSON.stringify('{"rasterizer":"quads","accumulation":"rgba32float","threads":"serial"}')};
  Storage.prototype.getItem = function (key) {
    return getItem.call(this, key) ?? (/^gaussian-splat \\d+ google swiftshader /.test(key) ? kept : null);
  };
}
`;

const otherOrigin = await startOtherOrigin();

/** Chromium hides float16 in shaders on NVIDIA under Linux; elsewhere this does nothing. */
const FLOAT16_FLAG = '--enable-dawn-features=vulkan_enable_f16_on_nvidia';

/**
 * Number of pages at once. SwiftShader draws on the CPU, but pages mostly wait; the groups are those of
 * scripts/lib/test-files.mjs.
 */
const CONCURRENCY = { timing: 1, concurrent: 2, dense: 1 };
const group = process.env.TEST_GROUP ?? 'timing';
const isSecondVisit = group === 'concurrent' && !['lab', 'full'].includes(process.env.TESTS);
const named = process.env.TEST_FILES?.split(' ').filter(Boolean);

export default {
  reporters: [
    defaultReporter({ reportTestResults: true, reportTestProgress: process.stdout.isTTY }),
    slowestReporter(),
    countReporter(),
  ],
  files: (isSecondVisit ? named && sharePages(named) : named) ?? ['tests/**/browser/**/*.test.ts', `!${DENSE}`],
  rootDir: '.',
  // Runs beside each other have a port each; otherwise the first one that is free.
  port: process.env.TEST_PORT ? Number(process.env.TEST_PORT) : undefined,
  // Without `development`, which is the default, Lit does not warn. With `production` a page would have the element twice: tests import its modules, too.
  nodeResolve: { exportConditions: ['browser'] },
  concurrency: CONCURRENCY[group],
  concurrentBrowsers: 1,
  browserStartTimeout: 240_000,
  testsFinishTimeout: 2_400_000,
  // The limits of `until` find tests that hang, because they are shorter.
  testFramework: { config: { ui: 'bdd', timeout: 900_000 } },
  testRunnerHtml: (framework) =>
    `<!doctype html><html><body><script>${isSecondVisit ? SECOND_VISIT : ''}STABILITY = ${JSON.stringify(process.env.STABILITY ?? 'fast')}; TESTS = ${JSON.stringify(process.env.TESTS ?? 'fast')}</script><script type="module" src="${framework}"></script></body></html>`,
  browsers: [chromium(group === 'dense' ? 2 : 1)],
  middleware: [hostileServer(otherOrigin)],
  plugins: [typescript(), pageCommands()],
};

/** The files and the single tests that took longest, in whole seconds: where to look when the tests have become slow. */
function slowestReporter(count = 12) {
  const testsOf = (suite) => [...(suite?.tests ?? []), ...(suite?.suites ?? []).flatMap(testsOf)];
  const print = (rows) => {
    const slowest = rows.sort((a, b) => b.ms - a.ms).slice(0, count);
    for (const { name, ms } of slowest) console.log(`${(ms / 1000).toFixed(0).padStart(4)} s ${name}`);
  };
  return {
    onTestRunFinished({ sessions }) {
      const files = sessions.map(({ testFile, testResults }) => {
        const tests = testsOf(testResults).map(({ name, duration: ms = 0 }) => ({ name, ms }));
        return { name: testFile, ms: tests.reduce((sum, { ms }) => sum + ms, 0), tests };
      });
      print(files.flatMap(({ tests }) => tests));
      print(files);
    },
  };
}

/** The files that failed, and one closing line that counts every test of every group, in the words that `npm test` reads. */
function countReporter() {
  const countOf = (suite) => {
    const own = { passed: 0, failed: 0, skipped: 0 };
    for (const { skipped, passed } of suite?.tests ?? []) own[skipped ? 'skipped' : passed ? 'passed' : 'failed']++;
    return (suite?.suites ?? []).map(countOf).reduce(add, own);
  };
  const failedIn = (suite, path = []) => [
    ...(suite?.tests ?? [])
      .filter(({ passed, skipped }) => !passed && !skipped)
      .map((test) => ({ ...test, name: [...path, test.name].join(' > ') })),
    ...(suite?.suites ?? []).flatMap((inner) => failedIn(inner, inner.name ? [...path, inner.name] : path)),
  ];
  const add = (a, b) => ({ passed: a.passed + b.passed, failed: a.failed + b.failed, skipped: a.skipped + b.skipped });
  return {
    onTestRunFinished({ sessions }) {
      const { passed, failed, skipped } = sessions.map(({ testResults }) => countOf(testResults)).reduce(add);
      // A file that never ran has no results, only errors.
      const broken = sessions.filter(
        ({ passed: fine, testResults }) => !fine && countOf(testResults).failed === 0,
      ).length;
      for (const { testFile, testResults, errors } of sessions.filter((session) => !session.passed)) {
        const tests = failedIn(testResults);
        const found = tests.length > 0 ? tests : [{ name: 'the file', error: errors[0] }];
        // Tests that a failed hook has ended before they began have no message.
        for (const { name, error } of found)
          process.stdout.write(failureLine(relative(root, testFile), name, (error ?? errors[0])?.message));
      }
      console.log(`Chromium: ${passed} passed, ${failed + broken} failed, ${skipped} skipped`);
    },
  };
}

/** Replaces the files of each shared page by one that imports them. */
function sharePages(files) {
  const folder = 'test-output/pages';
  mkdirSync(join(root, folder), { recursive: true });
  const shared = SHARED_PAGES.map((page) => page.filter((file) => files.includes(file)));
  const pages = shared.filter(({ length }) => length > 1);
  const made = pages.map((page) => {
    const path = `${folder}/${page.map((file) => basename(file, '.test.ts')).join('-')}.test.ts`;
    writeFileSync(join(root, path), page.map((file) => `import '/${file}';\n`).join(''));
    return path;
  });
  return [...made, ...files.filter((file) => !pages.flat().includes(file))];
}

function chromium(pixelRatio) {
  return playwrightLauncher({
    product: 'chromium',
    launchOptions: {
      executablePath: findChromium(),
      args: [...gpuFlags(), FLOAT16_FLAG, `--force-device-scale-factor=${pixelRatio}`],
    },
    // The switch changes what canvases see, the context what scripts see: only together are they a dense screen.
    createBrowserContext: ({ browser }) => browser.newContext({ deviceScaleFactor: pixelRatio }),
  });
}
