/** `npm run detail:chart`: splats drawn for each that contributes, and dB, at growing distances. See scripts/detail-chart-scene.mjs. */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensureBuilt();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader()) ensureChromium();
process.exit(
  run(process.execPath, ['scripts/detail-chart-scene.mjs', ...process.argv.slice(2)], { env: gpuEnvironment() }),
);
