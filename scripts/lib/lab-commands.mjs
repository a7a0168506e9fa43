/** Measurements of the laboratory, for `npm run lab`. */
const TSX = ['--import', 'tsx'];
const QUIET = '--no-warnings';
const SOCKETS = '--experimental-websocket';

/**
 * For each name: the purpose, and the command. `in` says what it needs besides the packages: headless Chromium, Dawn in
 * Node, or nothing, because the command prepares all itself. `smallest`: arguments of the shortest run, which a test
 * of the laboratory makes; {folder} is an empty folder, {shared} that of the captured scenes, {detail} one of levels of detail. `installs`: it installs packages of npm.
 * Rows without it need an engine, packages of Python, or a GPU.
 */
export const COMMANDS = {
  attack: {
    what: 'hostile files in a page: memory, time, messages',
    in: 'chromium',
    command: ['scripts/attack/run-attack.mjs'],
    smallest: ['{shared}/cases/attack', '--only', 'ply-many-rest', '--seconds', '20'],
  },
  bench: {
    what: 'frame times beside other viewers',
    in: 'chromium',
    command: ['scripts/bench/run-bench.mjs'],
    smallest: ['--splats', '2000', '--size', '64x48', '--frames', '1', '--rounds', '1', '--no-peers'],
  },
  bytes: {
    what: 'file sizes against image accuracy',
    in: 'dawn',
    command: ['scripts/bytes/run-bytes.mjs'],
    smallest: [
      '--kept',
      '--data',
      '{shared}/data',
      '--scenes',
      'skull',
      '--views',
      '1',
      '--work',
      '{folder}/bytes',
      '--out',
      '{folder}',
    ],
  },
  clip: {
    what: 'bytes and accuracy of clips',
    in: 'dawn',
    command: [...TSX, 'tests/support/clip-report.ts'],
    smallest: ['--splats', '100', '--frames', '4', '--per-file', '2', '--min-psnr', '34', '--cpu'],
  },
  'clip-errors': {
    what: 'the accuracy that is printed of clips, beside the worst of all their frames',
    in: 'dawn',
    command: [...TSX, 'tests/support/clip-errors.ts'],
    smallest: ['--only', 'drift', '--splats', '150', '--frames', '3', '--views', '4', '--min-psnr', '40', '--cpu'],
  },
  'detail-chart': {
    what: 'levels of detail: error, splats, time',
    in: 'dawn',
    command: ['scripts/charts/detail.mjs'],
    smallest: ['--size', '48x32', '--distances', '1', '--detail', '1'],
  },
  'detail-flight': {
    what: 'page requests of a flight, simulated',
    command: [...TSX, 'tests/support/flight-report.ts'],
    smallest: ['{detail}', '64', '20'],
  },
  firefox: { what: 'element and site in Firefox', command: [SOCKETS, QUIET, 'scripts/firefox.mjs'] },
  flight: {
    what: 'a flight over a streamed tileset: error, late frames, requests',
    in: 'chromium',
    command: [...TSX, 'scripts/flight/run-flight.mjs'],
    smallest: [
      ...['--in', 'element,maplibre', '--blocks', '1', '--frames', '4', '--warm', '2', '--size', '96x54'],
      ...['--megabytes', '60', '--splats', '300000'],
    ],
  },
  frontier: {
    what: 'speed against accuracy on this GPU',
    in: 'chromium',
    command: ['scripts/frontier/run-frontier.mjs'],
    smallest: [
      '--size',
      '64x48',
      '--views',
      '1',
      '--frames',
      '1',
      '--rounds',
      '1',
      '--only',
      '^default$',
      '--out',
      '{folder}',
    ],
  },
  fuzz: {
    what: 'random scenes and cameras against the oracle',
    in: 'dawn',
    command: [...TSX, 'tests/stability/fuzz/run-fuzz.ts'],
    smallest: ['--cases', '2', '--seed', '1'],
  },
  'fuzz-formats': {
    what: 'damaged files of every format',
    command: ['scripts/fuzz-formats.mjs'],
    smallest: ['--count', '20'],
  },
  gate: {
    what: 'the smallest files within a target of accuracy',
    in: 'dawn',
    command: ['scripts/gate/run-gate.mjs'],
  },
  grid: {
    what: 'many elements on one page',
    in: 'chromium',
    command: ['scripts/grid/run-grid.mjs'],
    smallest: ['--seconds', '30'],
  },
  lighthouse: {
    what: 'paints and layout shift of the site, on a simulated phone',
    in: 'chromium',
    command: ['scripts/lighthouse.mjs'],
    installs: true,
    smallest: ['--only', '^/docs/guide/start/$', '--runs', '1'],
  },
  lives: {
    what: 'elements that are added and removed',
    in: 'chromium',
    command: ['scripts/lives.mjs'],
    smallest: ['40'],
  },
  load: {
    what: 'times from navigation to the first frame',
    in: 'chromium',
    command: ['scripts/bench/run-load.mjs'],
    smallest: ['demo/scenes/skull.spz', '--viewers', 'ours', '--rounds', '1'],
  },
  posters: {
    what: 'posters of the site, as its scenes are first drawn',
    command: ['scripts/posters.mjs'],
    smallest: ['--only', '^robot$', '--out', '{folder}/posters'],
  },
  scale: {
    what: 'builds of streamed scenes in parts, and what a billion splats take',
    command: ['scripts/scale/run-scale.mjs'],
    smallest: ['--splats', '20000', '--cells', '302MB'],
  },
  screenshots: {
    what: 'every page of the site, for people to look at',
    command: ['scripts/screenshots.mjs'],
    smallest: ['--only', '^/compare/$', '--widths', '390', '--seconds', '1', '--out', '{folder}/screenshots'],
  },
  soak: {
    what: 'hours of random actions with flat memory',
    in: 'chromium',
    command: ['scripts/soak/run-soak.mjs'],
    smallest: ['--minutes', '0.1'],
  },
  stability: {
    what: 'known failures of renderers',
    command: ['scripts/stability.mjs'],
    smallest: ['--fast', 'unusable-values'],
  },
  studio: {
    what: 'scenes with known geometry, made from nothing on an NVIDIA GPU',
    command: ['scripts/studio/run-studio.mjs'],
  },
  tools: { what: 'files of public tools, both ways', command: ['scripts/tools.mjs'], installs: true, smallest: [] },
  webgl: {
    what: 'WebGL 2 against the oracle',
    command: [SOCKETS, QUIET, ...TSX, 'scripts/webgl.mjs'],
    smallest: ['--chromium-only'],
  },
  webkit: { what: 'element and site in WebKitGTK', command: [QUIET, 'scripts/webkit.mjs'] },
  wgpu: { what: 'golden tests on the WebGPU of Firefox', command: ['scripts/wgpu.mjs'] },
};
