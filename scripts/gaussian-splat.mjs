/** `npm run gaussian-splat -- COMMAND ...`: the command-line package of packages/cli in a checkout. Installs and builds what is missing. */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureDependencies, ensureElement, ensurePackages } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

const args = process.argv.slice(2);

ensureDependencies();
if (args[0] === 'page') ensureElement();
else ensurePackages();
const draws = ['render', 'video', 'economise'].includes(args[0]);
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (draws && process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader())
  ensureChromium();
process.exit(run(process.execPath, ['packages/cli/bin/gaussian-splat.mjs', ...args], { env: gpuEnvironment() }));
