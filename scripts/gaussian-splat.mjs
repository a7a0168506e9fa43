/** `npm run gaussian-splat -- COMMAND ...`: the command-line package of packages/cli in a checkout. Installs and builds missing parts. */
import { join } from 'node:path';
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureDependencies, ensureElement, ensurePackages } from './lib/prepare.mjs';
import { root, run } from './lib/run.mjs';

const args = process.argv.slice(2);

ensureDependencies();
if (args[0] === 'page') ensureElement();
else ensurePackages();
const draws = ['render', 'video', 'detail', 'optimize', 'sequence'].includes(args[0]);
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (draws && process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader())
  ensureChromium();
const bin = join(root, 'packages/cli/bin/gaussian-splat.mjs');
// npm runs scripts in the root of the repository; paths of users are relative to the folder that they called npm in.
process.exit(
  run(process.execPath, [bin, ...args], { env: gpuEnvironment(), cwd: process.env.INIT_CWD ?? process.cwd() }),
);
