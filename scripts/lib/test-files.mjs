/** The list of test files, and the environment of each: this is the only place that defines it. Paths are relative to the root, with slashes. */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from './run.mjs';

/**
 * `*.lab.test.ts`: the laboratory's, by `npm run test:lab`: tools that reduce scenes or measure others, in all their breadth; tests that measure time; the same again in
 * another framework, another family of models, on another screen, or a hundred times. `npm test` keeps the behavior of the product, each in one way, and a smoke test of most tools.
 */
export const isLaboratory = (file) => file.endsWith('.lab.test.ts');

/**
 * `*.alone.test.ts`, or `*.alone.lab.test.ts`. In Node: has a process of its own, because it changes state that the process shares (globals, shaders, the clock, the device). In Chromium: no other page
 * runs beside it, because it measures time, has the server lose files, or ends the GPU process.
 */
const isAlone = (file) => /\.alone\.(lab\.)?test\.ts$/.test(file);

/** Has a browser of its own, whose screen is dense. */
export const DENSE = 'tests/element/browser/high-density.lab.test.ts';
/**
 * Files of Chromium that run in one page in `npm test`, which compiles the pipelines of a device once: they change nothing of the page that outlives them, and do not count what it has fetched or
 * holds. `credits` comes first: no page has its code before.
 */
export const SHARED_PAGES = [
  [
    ...['element', 'credits', 'trees', 'pages', 'scene'],
    ...['labels', 'meaning', 'measure', 'depth', 'slow-reads', 'splats', 'groups'],
  ],
  [
    ...['element', 'accessibility', 'addresses', 'doors', 'embed', 'image-loss', 'clip', 'scenes'],
    ...['mesh-files', 'meshes', 'interaction', 'effects', 'views'],
  ],
  ['element', 'ar', 'vr'],
  ['generator', 'models', 'placement', 'post-gaussians', 'video-input', 'cpu-check'],
  ['formats', 'gunzip', 'webp'],
].map(([folder, ...names]) => names.map((name) => `tests/${folder}/browser/${name}.test.ts`));

/** Files of Node that run in one process with the device of tests/support, and thus reuse its compiled pipelines. */
const SHARES_DEVICE = /^tests\/(detail|golden|stages)\//;
/** These files have a process each: they take the machine's memory or threads. Others share one: to start it takes longer than most of them. */
const ONE_EACH = /^tests\/(optimize\/|packages\/(batch|commands|test-names|.*\.lab)\.|detail\/(command|parts)\.)/;

/** Folders of each package's tests. Tests of demo and documents belong to the site. */
export const TESTS_OF = {
  core: ['contract', 'onnx'],
  formats: ['formats'],
  renderer: ['stages', 'golden', 'detail', 'memory', 'oracle', 'stability'],
  generator: ['generator'],
  check: ['check'],
  optimize: ['optimize'],
  cli: ['packages'],
  element: ['element', 'packages'],
  react: ['frameworks'],
  three: ['three'],
  site: ['site'],
};

/** All test files, by environment. */
export function testFiles() {
  const all = filesIn('tests').filter((file) => file.endsWith('.test.ts'));
  const [browser, node] = [all.filter(inBrowser), all.filter((file) => !inBrowser(file))];
  return { browser, node };
}

/** Whether some tests of a file are the laboratory's (`onlyInLab` of tests/support/extent.ts). */
export const hasBreadth = (file) =>
  /\bonlyInLab\b|\b(is|itIn)Lab\b|\bsomeOf\b|SITE === 'full'/.test(readFileSync(join(root, file), 'utf8'));

/** Files of Node: those that use one device, those that use one process, and those that have one each. */
export function byProcess(files) {
  const kindOf = (file) => {
    if (isAlone(file) || ONE_EACH.test(file)) return 'alone';
    return SHARES_DEVICE.test(file) ? 'sharing' : 'together';
  };
  const ofKind = (kind) => files.filter((file) => kindOf(file) === kind);
  return { sharing: ofKind('sharing'), together: ofKind('together'), alone: ofKind('alone') };
}

/** Files of Chromium by group, in the order of the groups. */
export function byGroup(files) {
  return {
    timing: files.filter((file) => isAlone(file) && file !== DENSE),
    concurrent: files.filter((file) => !isAlone(file) && file !== DENSE),
    dense: files.filter((file) => file === DENSE),
  };
}

/** How much has to be built for some tests: the packages alone, or the site, too. */
export function buildFor(files) {
  return files.some((file) => inBrowser(file) || /^tests\/(check|element|frameworks|packages|site)\//.test(file))
    ? 'whole'
    : 'packages';
}

function inBrowser(file) {
  return file.includes('/browser/');
}

function filesIn(folder) {
  return readdirSync(join(root, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = `${folder}/${entry.name}`;
    return entry.isDirectory() ? filesIn(path) : [path];
  });
}
