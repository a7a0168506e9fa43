/** `npm run bench`: the benchmark page in headless Chromium, with a table in the terminal. See docs/benchmark.md. */
import { ensureChromium } from './lib/chromium.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensureBuilt();
process.env.CHROMIUM = ensureChromium();
process.exit(run(process.execPath, ['scripts/bench/run-bench.mjs', ...process.argv.slice(2)]));
