/** `npm run economise`: makes a scene smaller without going below a figure in dB. See scripts/economise-scene.mjs. */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureDependencies, ensurePackages } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensurePackages();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader()) ensureChromium();
process.exit(
  run(process.execPath, ['scripts/economise-scene.mjs', ...process.argv.slice(2)], { env: gpuEnvironment() }),
);
