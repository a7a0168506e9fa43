/** Hashes of the CDN build's scripts, by their paths in `packages/element/cdn`, as `npm run build` has just written them. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

export default function integrity() {
  return JSON.parse(readFileSync(join(root, 'packages/element/cdn/integrity.json'), 'utf8'));
}
