/** `npm run frontier:ladder`: what each rung of pictures in motion takes and loses. See scripts/frontier/measure-ladder.mjs. */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensureBuilt();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader()) ensureChromium();
process.exit(run(process.execPath, ['scripts/frontier/measure-ladder.mjs'], { env: gpuEnvironment() }));
