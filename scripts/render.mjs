/** `npm run render`: draws one image of a scene without a browser. See scripts/render-image.mjs. */
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureDependencies, ensurePackages } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensurePackages();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader()) ensureChromium();
process.exit(run(process.execPath, ['scripts/render-image.mjs', ...process.argv.slice(2)], { env: gpuEnvironment() }));
