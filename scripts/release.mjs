/**
 * `npm run release [-- FOLDER] [--serve]`: writes what a maintainer publishes into FOLDER (default: release). Nothing is published. With `--serve` it then is a registry
 * for the npm of this machine: `npm install @gaussian-splat/element --@gaussian-splat:registry=http://localhost:4873/`.
 */
import { readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { root } from './lib/run.mjs';

const words = process.argv.slice(2);
const [named] = words.filter((word) => word !== '--serve');
const folder = resolve(process.env.INIT_CWD ?? '.', named ?? join(root, 'release'));

ensureDependencies();
ensureBuilt();
const { serveRegistry, writeRelease } = await import('./lib/release.mjs');
const { files, tarballs } = writeRelease(folder);
console.log(`${folder}\n${files.map((file) => `  ${file}`).join('\n')}\n  SHA256SUMS\n`);
const { repository } = JSON.parse(readFileSync(join(root, 'package.json'), 'utf8'));
if (words.includes('--serve')) {
  await serveRegistry(tarballs, 4873);
  console.log(
    'While this runs: npm install @gaussian-splat/element --@gaussian-splat:registry=http://localhost:4873/ (Ctrl+C ends it)',
  );
} else {
  if (!repository)
    console.log(
      'package.json names no repository, which npm asks for with --provenance: add it, there and to packages/*.',
    );
  console.log('To publish, in the CI of that repository: for f in npm/*.tgz; do npm publish --provenance "$f"; done');
}
