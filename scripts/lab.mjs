/** `npm run lab:NAME`: a measurement of the laboratory, once all that it needs is installed and built. docs/benchmark.md and docs/stability.md say what each of them measures. */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

/** Tests in headless Chromium, and tests of Dawn in Node. */
const IN_CHROMIUM = {
  bench: ['scripts/bench/run-bench.mjs'],
  frontier: ['scripts/frontier/run-frontier.mjs'],
  soak: ['scripts/soak/run-soak.mjs'],
  grid: ['scripts/grid/run-grid.mjs'],
  attack: ['scripts/attack/run-attack.mjs'],
  load: ['scripts/bench/run-load.mjs'],
};
const IN_NODE = {
  fuzz: ['--import', 'tsx', 'tests/stability/fuzz/run-fuzz.ts'],
  'detail-chart': ['scripts/charts/detail.mjs'],
  bytes: ['scripts/bytes/run-bytes.mjs'],
  gate: ['scripts/gate/run-gate.mjs'],
  clip: ['--import', 'tsx', 'tests/support/clip-report.ts'],
};

const [name, ...args] = process.argv.slice(2);
ensureDependencies();
ensureBuilt();
if (name in IN_CHROMIUM) {
  process.env.CHROMIUM = ensureChromium();
  process.exit(run(process.execPath, [...IN_CHROMIUM[name], ...args]));
}
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader()) ensureChromium();
process.exit(run(process.execPath, [...IN_NODE[name], ...args], { env: gpuEnvironment() }));
