/**
 * `npm run lab -- NAME [OPTIONS]`: a measurement of the laboratory, once all that it needs is installed and built. Without a name it lists them. docs/benchmark.md and docs/stability.md
 * say what each of them measures; `--help` of most prints their options.
 */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

const TSX = ['--import', 'tsx'];
const QUIET = '--no-warnings';
const SOCKETS = '--experimental-websocket';

/**
 * For each name: the purpose, and the command. `in` says what it needs besides the packages: headless Chromium, Dawn in
 * Node, or nothing, because the command prepares all itself.
 */
const COMMANDS = {
  attack: {
    what: 'hostile files in a page: memory, time, messages',
    in: 'chromium',
    command: ['scripts/attack/run-attack.mjs'],
  },
  bench: { what: 'frame times beside other viewers', in: 'chromium', command: ['scripts/bench/run-bench.mjs'] },
  bytes: { what: 'file sizes against image accuracy', in: 'dawn', command: ['scripts/bytes/run-bytes.mjs'] },
  clip: { what: 'bytes and accuracy of clips', in: 'dawn', command: [...TSX, 'tests/support/clip-report.ts'] },
  'detail-chart': { what: 'levels of detail: error, splats, time', in: 'dawn', command: ['scripts/charts/detail.mjs'] },
  'detail-flight': {
    what: 'page requests of a flight, simulated',
    command: [...TSX, 'tests/support/flight-report.ts'],
  },
  firefox: { what: 'element and site in Firefox', command: [SOCKETS, QUIET, 'scripts/firefox.mjs'] },
  frontier: {
    what: 'speed against accuracy on this GPU',
    in: 'chromium',
    command: ['scripts/frontier/run-frontier.mjs'],
  },
  fuzz: {
    what: 'random scenes and cameras against the oracle',
    in: 'dawn',
    command: [...TSX, 'tests/stability/fuzz/run-fuzz.ts'],
  },
  'fuzz-formats': { what: 'damaged files of every format', command: ['scripts/fuzz-formats.mjs'] },
  gate: { what: 'the smallest files within a target of accuracy', in: 'dawn', command: ['scripts/gate/run-gate.mjs'] },
  grid: { what: 'many elements on one page', in: 'chromium', command: ['scripts/grid/run-grid.mjs'] },
  lives: { what: 'elements that are added and removed', command: ['scripts/lives.mjs'] },
  load: { what: 'times from navigation to the first frame', in: 'chromium', command: ['scripts/bench/run-load.mjs'] },
  posters: { what: 'posters of the site, as its scenes are first drawn', command: ['scripts/posters.mjs'] },
  screenshots: { what: 'every page of the site, for people to look at', command: ['scripts/screenshots.mjs'] },
  soak: { what: 'hours of random actions with flat memory', in: 'chromium', command: ['scripts/soak/run-soak.mjs'] },
  stability: { what: 'known failures of renderers', command: ['scripts/stability.mjs'] },
  studio: {
    what: 'scenes with known geometry, made from nothing on an NVIDIA GPU',
    command: ['scripts/studio/run-studio.mjs'],
  },
  tools: { what: 'files of public tools, both ways', command: ['scripts/tools.mjs'] },
  webgl: { what: 'WebGL 2 against the oracle', command: [SOCKETS, QUIET, ...TSX, 'scripts/webgl.mjs'] },
  webkit: { what: 'element and site in WebKitGTK', command: [QUIET, 'scripts/webkit.mjs'] },
  wgpu: { what: 'golden tests on the WebGPU of Firefox', command: ['scripts/wgpu.mjs'] },
};

const [name, ...args] = process.argv.slice(2);
if (!Object.hasOwn(COMMANDS, name ?? '')) {
  if (name !== undefined) console.error(`npm run lab: no measurement is named ${name}.`);
  const width = Math.max(...Object.keys(COMMANDS).map(({ length }) => length));
  console.log('usage: npm run lab -- NAME [OPTIONS]\n');
  for (const [key, { what }] of Object.entries(COMMANDS)) console.log(`  ${key.padEnd(width)}  ${what}`);
  process.exit(name === undefined ? 0 : 1);
}

const { command, in: place } = COMMANDS[name];
if (place !== undefined) {
  ensureDependencies();
  ensureBuilt();
}
if (place === 'chromium') process.env.CHROMIUM = ensureChromium();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
const isSoftware = process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system';
if (place === 'dawn' && isSoftware && !findSwiftShader()) ensureChromium();
process.exit(run(process.execPath, [...command, ...args], place === 'dawn' ? { env: gpuEnvironment() } : {}));
