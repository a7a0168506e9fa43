/** `npm run frontier`: speed against accuracy of every configuration, as JSON and as a chart. See docs/benchmark.md. */
import { ensureChromium } from './lib/chromium.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensureBuilt();
process.env.CHROMIUM = ensureChromium();
process.exit(run(process.execPath, ['scripts/frontier/run-frontier.mjs', ...process.argv.slice(2)]));
