/** `npm run detail`: writes a scene as a folder that is streamed from static hosting. See scripts/detail-scene.mjs. */
import { ensureDependencies, ensurePackages } from './lib/prepare.mjs';
import { run } from './lib/run.mjs';

ensureDependencies();
ensurePackages();
process.exit(run(process.execPath, ['scripts/detail-scene.mjs', ...process.argv.slice(2)]));
