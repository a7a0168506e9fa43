/** `npm run test:site`: builds, and runs all tests of the site, every document included. */
import { ensureChromium } from './lib/chromium.mjs';
import { build, ensureDependencies } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';
import { testFiles } from './lib/test-files.mjs';

ensureDependencies();
const CHROMIUM = ensureChromium();
build();
const files = testFiles().node.filter((file) => file.startsWith('tests/site/'));
process.exit(run(process.execPath, ['--import', 'tsx', '--test', ...files], { env: { CHROMIUM, SITE: 'full' } }));
