/** Bytes of the apartment's versions that the first page compares: `npm run lab -- posters` wrote them beside their images. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

const megabytes = (bytes) => `${(bytes / 1e6).toFixed(1)} MB`;

export default function versions() {
  const { ply, small } = JSON.parse(readFileSync(join(root, 'demo/scenes/posters/versions.json'), 'utf8'));
  return { original: megabytes(ply), small: megabytes(small), times: Math.floor(ply / small) };
}
