/** `npm run test:site`: builds, and runs all tests of the site, every document included. */
import { ensureChromium } from './lib/chromium.mjs';
import { build, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
const CHROMIUM = ensureChromium();
build();
const files = ['pages', 'links', 'snippets', 'home', 'playground', 'compare', 'cost-card'].map(
  (name) => `tests/site/${name}.test.ts`,
);
process.exit(run(process.execPath, ['--import', 'tsx', '--test', ...files], { env: { CHROMIUM, SITE: 'full' } }));
