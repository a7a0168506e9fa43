/**
 * `npm run release [-- FOLDER]`: writes what a maintainer publishes into FOLDER (default: release): archives for sites
 * and for apps, the packages for npm, and the digests of all of them. Nothing is published.
 */
import { readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { root } from './lib/run.mjs';

const folder = resolve(process.env.INIT_CWD ?? '.', process.argv[2] ?? join(root, 'release'));

ensureDependencies();
ensureBuilt();
const { writeRelease } = await import('./lib/release.mjs');
const { files } = writeRelease(folder);
console.log(`${folder}\n${files.map((file) => `  ${file}`).join('\n')}\n  SHA256SUMS\n`);
const { repository } = JSON.parse(readFileSync(join(root, 'package.json'), 'utf8'));
if (!repository)
  console.log(
    'package.json names no repository, which npm asks for with --provenance: add it, there and to packages/*.',
  );
console.log('To publish, in the CI of that repository: for f in npm/*.tgz; do npm publish --provenance "$f"; done');
