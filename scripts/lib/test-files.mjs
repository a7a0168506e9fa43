/** Which test files there are, and which run where: this is the one place that knows. Paths are relative to the root, with slashes. */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from './run.mjs';

/**
 * The laboratory, by `npm run test:lab`: tools that look for fewer splats or measure others, in all their breadth; what is judged by a clock; the same again in
 * another framework, another family of models, on another screen, or a hundred times. `npm test` keeps the behaviour of the product, each in one way, and a smoke test of most tools.
 */
const LABORATORY = [
  /^tests\/economise\/(?!command|live-mask)/,
  /^tests\/bench\/(scene|pages)/,
  /^tests\/frameworks\/browser\/(plain|react-strict|rendered|scenes|vue)/,
  /^tests\/site\/(compare|cost-card|playground)/,
  /^tests\/check\/browser\//,
  // Clocks, large files, long lives, other documents, a dense screen and the controls of others.
  /^tests\/element\/browser\/(documents|high-density|large-ply|lives|loads-apart|media-chrome|pace|previews)/,
  // Every family, the examples, and each way in; the mechanism is tested by session, proof, faults, element, instances and post-element.
  /^tests\/generator\/browser\/(controls|examples\/|families|models|orbit|picture|post-unreachable|provider|scenes|shapes)/,
  // three.js beside the element; meshes draw with it in npm test.
  /^tests\/three\/browser\//,
  // What the registry and `npm run release` are given.
  /^tests\/packages\/(publish|release)/,
  // Extremes of scenes and streams; npm test draws each kind of scene, setting and format against the oracle.
  /^tests\/detail\/(ahead|at-rest|quantized)/,
  /^tests\/golden\/(depth-key-bits|detail|ingest-shapes|local-precision|rounded-apart|translation)/,
  /^tests\/stability\/catalogue/,
  // Stages and WebGL are tested in Node and in the element; losses of the device in device.
  /^tests\/stages\/browser\//,
  /^tests\/stability\/browser\/(device-loss|gpu-crash|memory-budget|resize)/,
];
/** Tests in Chromium that look at what happens in time, or have the server lose files: no other page runs beside them. */
const TIMING = [
  'tests/element/browser/behaviours.test.ts',
  'tests/element/browser/input.test.ts',
  'tests/element/browser/lifecycle.test.ts',
  'tests/element/browser/lost-code.test.ts',
  'tests/element/browser/meanwhile.test.ts',
  'tests/element/browser/pace.test.ts',
  'tests/element/browser/picking.test.ts',
  'tests/element/browser/previews.test.ts',
  'tests/element/browser/refused-chunks.test.ts',
  'tests/element/browser/visitors.test.ts',
  'tests/generator/browser/element.test.ts',
  'tests/generator/browser/instances.test.ts',
  'tests/generator/browser/orbit.test.ts',
  // It ends the GPU process of the browser, which all pages share.
  'tests/stability/browser/gpu-crash.test.ts',
];
/** Runs in a browser of its own, whose screen is dense. */
const DENSE = 'tests/element/browser/high-density.test.ts';
/** Files of Node that take the device of tests/support share a process, and so the device and what it has compiled. */
const SHARES_DEVICE = /^tests\/(detail|golden|stages)\//;
/** What changes shaders for the whole process, or the shared device for good. */
const OWN_PROCESS = [
  'tests/golden/frame-levers.test.ts',
  'tests/golden/host.test.ts',
  'tests/golden/short-shaders.test.ts',
  'tests/golden/world.test.ts',
];
const TAKES_DEVICE = /from '[./]*support\/(node-device|read-rows|draw-until-calm|work-counters)\.js'/;

/** Files of Node without a device that leave their process as it was share another: to start one takes longer than most of them. */
const SHARES_PROCESS = /^tests\/(?!economise|packages)/;
const CHANGES_PROCESS =
  /\b(globalThis|mock|memoryUsage)\b|\bprocess\.(?!platform|execPath|cwd|env\.\w+\b(?! =))|performance\.now =|support\/(node-device|devices)|node-gpu/;

/** Where the tests of each package are; those of demo and documents are the site's. */
export const TESTS_OF = {
  core: ['contract', 'onnx'],
  formats: ['formats'],
  renderer: ['stages', 'golden', 'detail', 'memory', 'oracle', 'stability'],
  generator: ['generator'],
  check: ['check'],
  economise: ['economise'],
  cli: ['packages'],
  element: ['element', 'packages'],
  react: ['frameworks'],
  three: ['three'],
  site: ['site'],
};

/** All test files, by where they run. */
export function testFiles() {
  const all = filesIn('tests').filter((file) => file.endsWith('.test.ts'));
  const [browser, node] = [all.filter(inBrowser), all.filter((file) => !inBrowser(file))];
  return { browser, node };
}

export const isLaboratory = (file) => LABORATORY.some((pattern) => pattern.test(file));

/** Whether some tests of a file are the laboratory's (`onlyInLab` of tests/support/extent.ts). */
export const hasBreadth = (file) =>
  /\bonlyInLab\b|\b(is|itIn)Lab\b|\bsomeOf\b|SITE === 'full'/.test(readFileSync(join(root, file), 'utf8'));

/** Files of Node: those that share a device, those that share a process, and those that have one each. */
export function byProcess(files) {
  const kindOf = (file) => {
    const text = readFileSync(join(root, file), 'utf8');
    if (SHARES_DEVICE.test(file) && !OWN_PROCESS.includes(file) && TAKES_DEVICE.test(text)) return 'sharing';
    return SHARES_PROCESS.test(file) && !CHANGES_PROCESS.test(text) ? 'together' : 'alone';
  };
  const ofKind = (kind) => files.filter((file) => kindOf(file) === kind);
  return { sharing: ofKind('sharing'), together: ofKind('together'), alone: ofKind('alone') };
}

/** Files of Chromium by group, in the order in which the groups run. */
export function byGroup(files) {
  return {
    timing: files.filter((file) => TIMING.includes(file)),
    concurrent: files.filter((file) => !TIMING.includes(file) && file !== DENSE),
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
