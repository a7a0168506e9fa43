/** `npm run lab -- lives [CYCLES]`: 500 (or N) elements that are added and removed, 24 at once, 20 lost devices, in real Chromium. */
import { must } from './lib/run.mjs';

must(
  process.execPath,
  [
    'node_modules/@web/test-runner/dist/bin.js',
    ...['--config', 'web-test-runner.config.mjs', '--files', 'tests/element/browser/lives.lab.test.ts'],
  ],
  { env: { NODE_ENV: 'test', SOAK_CYCLES: process.argv[2] ?? '500' } },
);
