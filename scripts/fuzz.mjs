/** `npm run fuzz`: random scenes and cameras against the float64 oracle. See docs/stability.md. */
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensureBuilt();
const args = ['--import', 'tsx', 'tests/stability/fuzz/run-fuzz.ts', ...process.argv.slice(2)];
process.exit(run(process.execPath, args, { env: gpuEnvironment() }));
