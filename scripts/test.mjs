/**
 * `npm test`: installs missing parts (Node packages, a Chromium), builds, and tests the whole product: real Chromium with WebGPU and, beside it, the tests that draw in Node
 * (stages on Dawn, images against the oracle), the tests that need no GPU, types and style. Other ways to call it:
 * `npm test -- PATTERN ...` the test files whose path contains one; `-- --package NAME` the tests of one package; `-- --changed [COMMIT]` those of the packages that changed since a commit (else
 * since this branch left `main`) and of all that depend on them; `-- --full` tests whole lists, not a part of them.
 * `npm run test:lab` is `--lab`: the laboratory's breadth, which the product does not depend on.
 */
import { changedPackages, withDependants } from './lib/changed-packages.mjs';
import { chromiumVersion, ensureChromium } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuiltSoon, ensureDependencies, ensurePackages } from './lib/prepare.mjs';
import { runTests } from './lib/run-tests.mjs';
import { buildFor, hasBreadth, isLaboratory, testFiles, TESTS_OF } from './lib/test-files.mjs';

const words = process.argv.slice(2);
const isFull = take('--full');
const isLab = take('--lab');
const files = chosen();
const { node, browser } = files;
if (node.length + browser.length === 0) {
  console.log('No test file was asked for.\n\n0 passed, 0 failed, 0 skipped');
  process.exit(files.isFine ? 0 : 1);
}

ensureDependencies();
const chromium = ensureChromium();
console.log(`Chromium: ${chromiumVersion(chromium)} at ${chromium}`);
const isWhole = buildFor([...node, ...browser]) === 'whole';
const built = isWhole ? ensureBuiltSoon() : Promise.resolve(ensurePackages());

const extent = isFull
  ? { TESTS: 'full', STABILITY: 'full', SITE: 'full' }
  : isLab
    ? { TESTS: 'lab', SITE: 'full' }
    : {};
const env = { ...gpuEnvironment(), ...extent, CHROMIUM: chromium };
const { passed, failed, skipped, failures } = await runTests(files, {
  ...{ env, built },
  isStatic: files.isWhole,
  isLab,
});
for (const failure of failures) console.log(failure);
console.log(`\n${passed} passed, ${failed} failed, ${skipped} skipped`);
process.exit(failed > 0 || passed === 0 ? 1 : 0);

/** The files that the words ask for. */
function chosen() {
  const { node, browser } = testFiles();
  const only = (test) => ({ node: node.filter(test), browser: browser.filter(test) });
  if (isFull && words.length === 0) return { node, browser, isWhole: true };
  if (isLab) return only((file) => isLaboratory(file) || hasBreadth(file));
  const [option = '', name] = words;
  if (option === '--package') return only(ofPackages([known(name)]));
  if (option === '--changed') {
    const { files, packages } = changedPackages(name);
    const concerned = withDependants(packages);
    console.log(
      `${files.length} files changed, in ${packages.join(', ') || 'no package'}; tested: ${concerned.join(', ') || 'nothing'}`,
    );
    return { ...only((file) => ofPackages(concerned)(file) && !isLaboratory(file)), isFine: true };
  }
  if (option !== '') return only((file) => words.some((word) => file.includes(word)));
  return { ...only((file) => !isLaboratory(file)), isWhole: true };
}

function ofPackages(names) {
  const folders = new Set(names.flatMap((name) => TESTS_OF[name] ?? []));
  return (file) => folders.has(file.split('/')[1]);
}

function known(name) {
  if (Object.hasOwn(TESTS_OF, name)) return name;
  console.error(`--package ${name}: expected one of ${Object.keys(TESTS_OF).join(', ')}.`);
  process.exit(1);
}

function take(option) {
  const at = words.indexOf(option);
  if (at >= 0) words.splice(at, 1);
  return at >= 0;
}
