/** `npm run check -- MODEL [--contract CONTRACT.json] [--run]`: the conformance checker of packages/check. */
import { ensureDependencies, ensurePackages } from './lib/prepare.mjs';

ensureDependencies();
ensurePackages();
// npm runs scripts in the repository's root, wherever it was called.
process.chdir(process.env.INIT_CWD ?? '.');
const { main } = await import('../packages/check/dist/index.js');
process.exit(await main(process.argv.slice(2)));
