/**
 * `npm run test:gpu`: builds, and runs every test of Node that draws on the GPU of this machine instead of SwiftShader: stages, images against the oracle, levels of detail, pruning, memory, and the rows of the stability catalog as `npm test` runs them. `-- PATTERN` runs the files whose path contains it.
 */
import { readdirSync } from 'node:fs';
import { join } from 'node:path';
import { build, ensureDependencies } from './lib/prepare.mjs';
import { root, run } from './lib/run.mjs';

/** Folders of tests that draw. */
const FOLDERS = ['stages', 'golden', 'detail', 'optimize', 'memory', 'stability'];
/** Prints the adapter of the tests; fails if there is none. */
const NAME_ADAPTER = `import { requestNodeAdapter } from './packages/cli/src/lib/node-gpu.mjs';
const { vendor, architecture, device, description } = (await requestNodeAdapter()).info;
console.log('Adapter: ' + [vendor, architecture, device, description].filter(Boolean).join(' '));
process.exit();`;

process.env.GAUSSIAN_SPLAT_GPU = 'system';
const [pattern = ''] = process.argv.slice(2);
const files = FOLDERS.flatMap((folder) =>
  readdirSync(join(root, 'tests', folder))
    .filter((name) => name.endsWith('.test.ts'))
    .map((name) => `tests/${folder}/${name}`),
).filter((file) => file.includes(pattern));
if (files.length === 0) {
  console.error(`No test file in tests/{${FOLDERS.join(',')}} has "${pattern}" in its path.`);
  process.exit(1);
}
ensureDependencies();
build();
if (run(process.execPath, ['--input-type=module', '--eval', NAME_ADAPTER]) !== 0) process.exit(1);
const options = ['--import', 'tsx', '--test', '--test-reporter', 'spec', '--test-concurrency', '2'];
process.exit(run(process.execPath, [...options, ...files]));
