/** `npm run detail:chart`, `npm run sides:chart`: runs the chart of that name in this folder, with its options, where there is a GPU for Dawn. */
import { ensureChromium, findSwiftShader } from '../lib/chromium.mjs';
import { gpuEnvironment } from '../lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from '../lib/prepare.mjs';
import { run } from '../lib/run.mjs';

const [name, ...options] = process.argv.slice(2);
ensureDependencies();
ensureBuilt();
// On Linux, Dawn in Node uses the SwiftShader that comes with Chromium.
if (process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system' && !findSwiftShader()) ensureChromium();
process.exit(run(process.execPath, [`scripts/charts/${name}.mjs`, ...options], { env: gpuEnvironment() }));
