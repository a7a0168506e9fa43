/** `npm run soak`: the element in real Chromium for hours, with everything done to it that a page can do. See docs/stability.md. */
import { ensureChromium } from './lib/chromium.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensureBuilt();
process.env.CHROMIUM = ensureChromium();
process.exit(run(process.execPath, ['scripts/soak/run-soak.mjs', ...process.argv.slice(2)]));
